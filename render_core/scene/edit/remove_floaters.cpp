#include "render_core/scene/edit/remove_floaters.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include <glm/common.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/scene/keep_if.h"

namespace catgs {
namespace {

constexpr int side = 256;  // cells
constexpr float occupied_depth = 0.05f;
constexpr std::size_t surface_share = 1000;  // of the largest group's cells, one in
constexpr std::size_t block = 4096;          // of Gaussians, a thread's piece of work
constexpr float most_points = 16.0f;         // of a Gaussian, on each axis
constexpr float two_pi = 6.2831853f;

class Cells {
 public:
  Cells(const GaussianCloud& cloud, const Bounds& core, ThreadPool& pool);
  /// Marks the cells of surfaces, and their neighbours. False if no cell is occupied.
  bool find_surfaces();
  [[nodiscard]] bool on_surface(std::size_t gaussian) const;

 private:
  // States of a cell. While it is filled, its light is counted in these units up to `occupied`.
  static constexpr float unit_depth = 0x1p-24f;
  static constexpr auto occupied = static_cast<std::uint32_t>(occupied_depth / unit_depth);
  static constexpr std::uint32_t surface = occupied + 1, floating = occupied + 2;

  [[nodiscard]] std::size_t index_of(const glm::vec3& position) const;
  [[nodiscard]] glm::vec3 scale_in_cells(std::size_t gaussian) const;
  [[nodiscard]] bool is_large(std::size_t gaussian) const;
  template <class Visit>
  void spread(std::size_t gaussian, const Visit& visit) const;
  void add_light(std::size_t cell, float depth);
  template <class Visit>
  static void for_neighbours(std::uint32_t cell, const Visit& visit);
  std::vector<std::uint32_t> group_from(std::uint32_t seed);

  const GaussianCloud& cloud_;
  glm::vec3 middle_;
  float half_;  // side of the core's cube
  std::vector<std::uint32_t> cells_;
};

Cells::Cells(const GaussianCloud& cloud, const Bounds& core, ThreadPool& pool)
    : cloud_(cloud),
      middle_(0.5f * (core.min + core.max)),
      cells_(static_cast<std::size_t>(side) * side * side) {
  const glm::vec3 half = 0.5f * (core.max - core.min);
  half_ = std::max({half.x, half.y, half.z, 1e-6f});
  pool.parallel_for((cloud.size() + block - 1) / block, [&](std::size_t part) {
    const std::size_t end = std::min(cloud.size(), (part + 1) * block);
    for (std::size_t i = part * block; i < end; ++i)
      spread(i, [&](std::size_t cell, float depth) { add_light(cell, depth); });
  });
}

std::size_t Cells::index_of(const glm::vec3& position) const {
  glm::vec3 at = (position - middle_) / half_;
  const float norm = std::max({std::abs(at.x), std::abs(at.y), std::abs(at.z)});
  if (norm > 1.0f) at *= (2.0f - 1.0f / norm) / norm;
  std::size_t index = 0;
  for (int k = 2; k >= 0; --k) {
    const int cell = static_cast<int>((at[k] + 2.0f) * (0.25f * side));
    index = index * side + static_cast<std::size_t>(std::clamp(cell, 0, side - 1));
  }
  return index;
}

/// Where it stands, cells are about as large as this says.
glm::vec3 Cells::scale_in_cells(std::size_t gaussian) const {
  const glm::vec3 away = glm::abs(cloud_.mean[gaussian] - middle_) / half_;
  const float cell = 4.0f * half_ / side * std::max({1.0f, away.x, away.y, away.z});
  return cloud_.scale[gaussian] / cell;
}

bool Cells::is_large(std::size_t gaussian) const {
  const glm::vec3 scale = scale_in_cells(gaussian);
  return 6.0f * std::max({scale.x, scale.y, scale.z}) > most_points;
}

/// Calls visit(cell, optical depth) for points of a Gaussian up to 1.5 standard deviations from its
/// mean on each axis, half a cell apart unless the Gaussian is large.
template <class Visit>
void Cells::spread(std::size_t gaussian, const Visit& visit) const {
  const glm::vec3& mean = cloud_.mean[gaussian];
  const glm::vec3 scale = scale_in_cells(gaussian);
  const glm::ivec3 points(glm::clamp(glm::ceil(6.0f * scale), 1.0f, most_points));
  // The light that the broad side stops.
  const float area = two_pi * std::max({scale.x * scale.y, scale.y * scale.z, scale.z * scale.x});
  const float depth =
      cloud_.opacity[gaussian] * area / static_cast<float>(points.x * points.y * points.z);
  const glm::mat3 rotation = glm::mat3_cast(cloud_.rotation[gaussian]);
  glm::ivec3 k;
  for (k.z = 0; k.z < points.z; ++k.z)
    for (k.y = 0; k.y < points.y; ++k.y)
      for (k.x = 0; k.x < points.x; ++k.x) {
        const glm::vec3 at = 1.5f * ((2.0f * glm::vec3(k) + 1.0f) / glm::vec3(points) - 1.0f);
        visit(index_of(mean + rotation * (at * cloud_.scale[gaussian])), depth);
      }
}

/// Whether a cell becomes occupied does not depend on the order of its additions.
void Cells::add_light(std::size_t cell, float depth) {
  const std::atomic_ref<std::uint32_t> light(cells_[cell]);
  if (light.load(std::memory_order_relaxed) >= occupied) return;
  const float units = std::min(depth / unit_depth, static_cast<float>(occupied));
  light.fetch_add(static_cast<std::uint32_t>(units), std::memory_order_relaxed);
}

template <class Visit>
void Cells::for_neighbours(std::uint32_t cell, const Visit& visit) {
  const auto i = static_cast<int>(cell);
  const glm::ivec3 at(i % side, i / side % side, i / (side * side));
  const glm::ivec3 low = glm::max(at - 1, glm::ivec3(0));
  const glm::ivec3 high = glm::min(at + 1, glm::ivec3(side - 1));
  for (int z = low.z; z <= high.z; ++z)
    for (int y = low.y; y <= high.y; ++y)
      for (int x = low.x; x <= high.x; ++x)
        visit(static_cast<std::uint32_t>((z * side + y) * side + x));
}

/// The occupied cells that can be reached from `seed` over neighbours; they float, until more is
/// known.
std::vector<std::uint32_t> Cells::group_from(std::uint32_t seed) {
  std::vector<std::uint32_t> group = {seed};
  cells_[seed] = floating;
  for (std::size_t next = 0; next < group.size(); ++next)
    for_neighbours(group[next], [&](std::uint32_t cell) {
      if (cells_[cell] != occupied) return;
      cells_[cell] = floating;
      group.push_back(cell);
    });
  return group;
}

bool Cells::find_surfaces() {
  for (std::uint32_t& cell : cells_) cell = cell >= occupied ? occupied : 0;
  std::vector<std::vector<std::uint32_t>> groups;
  for (std::uint32_t cell = 0; cell < cells_.size(); ++cell)
    if (cells_[cell] == occupied) groups.push_back(group_from(cell));
  std::size_t largest = 0;
  for (const auto& group : groups) largest = std::max(largest, group.size());
  for (const auto& group : groups)
    if (surface_share * group.size() >= largest)
      for (const std::uint32_t on : group)
        for_neighbours(on, [&](std::uint32_t cell) { cells_[cell] = surface; });
  return largest > 0;
}

bool Cells::on_surface(std::size_t gaussian) const {
  bool found = is_large(gaussian);
  spread(gaussian, [&](std::size_t cell, float) { found = found || cells_[cell] == surface; });
  return found;
}

}  // namespace

std::size_t remove_floaters(GaussianCloud& cloud, ThreadPool& pool) {
  const std::optional<Bounds> core = robust_bounds(cloud);
  if (!core) return 0;
  Cells cells(cloud, *core, pool);
  if (!cells.find_surfaces()) return 0;
  std::vector<char> stays(cloud.size());
  pool.parallel_for((cloud.size() + block - 1) / block, [&](std::size_t part) {
    const std::size_t end = std::min(cloud.size(), (part + 1) * block);
    for (std::size_t i = part * block; i < end; ++i) stays[i] = cells.on_surface(i) ? 1 : 0;
  });
  const std::size_t before = cloud.size();
  keep_if(cloud, [&](std::size_t i) { return stays[i] != 0; });
  return before - cloud.size();
}

}  // namespace catgs
