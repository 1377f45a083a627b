#include "render_core/first_sight/standpoints.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/math/look_at.h"
#include "render_core/math/sphere.h"

namespace catgs::first_sight {
namespace {

constexpr float two_pi = 6.2831853f;
constexpr std::size_t directions = 192;
constexpr int headings = 16;
constexpr std::size_t max_views = 32;

// A camera stands in free space when the 27 cells around it would stop less than a fifth of the
// light.
constexpr float free_optical_depth = 0.2f;

/// The view from a point in all directions.
struct Surroundings {
  glm::vec3 point;
  float height = 0.0f;                       // above the ground
  float enclosure = 0.0f;                    // share of all directions that something stops
  float worth = 0.0f;                        // of the place, before a heading is chosen
  std::array<float, directions> distance{};  // to what stops the ray; `reach` where nothing does
};

class Explorer {
 public:
  Explorer(const VoxelGrid& grid, const Bounds& box, const glm::vec3& up)
      : grid_(grid),
        box_(box),
        up_(up),
        reach_(std::max(glm::distance(box.min, box.max), grid.cell_size())) {}

  /// The surroundings of a free place above some ground; nothing for others.
  [[nodiscard]] std::optional<Surroundings> explore(const glm::vec3& point) const;
  [[nodiscard]] InnerView view(const Surroundings& from, int heading) const;
  [[nodiscard]] float reach() const { return reach_; }

 private:
  const VoxelGrid& grid_;
  Bounds box_;
  glm::vec3 up_;
  float reach_;
  std::array<glm::vec3, directions> rays_ = sphere_directions<directions>();
};

std::optional<Surroundings> Explorer::explore(const glm::vec3& point) const {
  if (grid_.depth_around(point) > free_optical_depth) return std::nullopt;
  const float below = grid_.distance_along(point, -up_);
  if (below == VoxelGrid::never) return std::nullopt;
  Surroundings around{point};
  std::size_t stopped = 0;
  for (std::size_t d = 0; d < directions; ++d) {
    const float distance = grid_.distance_along(point, rays_[d]);
    stopped += distance < VoxelGrid::never;
    around.distance[d] = std::min(distance, reach_);
  }
  const float above = grid_.distance_along(point, up_);
  around.height = below;
  around.enclosure = static_cast<float>(stopped) / directions;
  const float height = above == VoxelGrid::never ? 0.5f : below / (below + above);
  around.worth = around.enclosure * std::max(0.0f, 1.0f - std::abs(height - 0.5f) / 0.35f);
  return around;
}

InnerView Explorer::view(const Surroundings& from, int heading) const {
  constexpr float seen = 0.77f, middle = 0.96f;  // cosines of 40 and 16 degrees
  constexpr float pitch_rad = -0.07f;            // floors tell more than ceilings
  constexpr float too_near = 0.12f;              // relative to the mean distance
  const glm::vec3 side = perpendicular(up_), front = glm::cross(side, up_);
  const float angle = two_pi * static_cast<float>(heading) / headings;
  const glm::vec3 level = std::cos(angle) * front + std::sin(angle) * side;
  const glm::vec3 forward = std::cos(pitch_rad) * level + std::sin(pitch_rad) * up_;
  float sum = 0.0f, ahead = 0.0f, nearest = reach_;
  int count = 0, count_ahead = 0;
  for (std::size_t d = 0; d < directions; ++d) {
    const float along = glm::dot(rays_[d], forward);
    if (along < seen) continue;
    sum += from.distance[d];
    ++count;
    nearest = std::min(nearest, from.distance[d]);
    if (along < middle) continue;
    ahead += from.distance[d];
    ++count_ahead;
  }
  const glm::vec3 inwards = 0.5f * (box_.min + box_.max) - from.point;
  const float facing =
      0.75f + 0.25f * glm::dot(level, inwards) / std::max(glm::length(inwards), 1e-6f);
  const float mean = sum / static_cast<float>(count);
  const float clear = std::min(1.0f, nearest / (too_near * mean));
  return {look_at(from.point, from.point + forward, up_),
          from.worth * facing * clear * mean / reach_,
          ahead / static_cast<float>(std::max(1, count_ahead)), from.height};
}

/// The most open views, none of which is nearly the same as a better one.
std::vector<InnerView> pick(std::vector<InnerView> views, float apart) {
  std::ranges::stable_sort(views, std::greater(), &InnerView::openness);
  std::vector<InnerView> picked;
  for (const InnerView& view : views) {
    const bool same = std::ranges::any_of(picked, [&](const InnerView& other) {
      return glm::distance(view.pose.position, other.pose.position) < apart &&
             std::abs(glm::dot(view.pose.orientation, other.pose.orientation)) > 0.94f;
    });
    if (!same) picked.push_back(view);
    if (picked.size() == max_views) break;
  }
  return picked;
}

}  // namespace

Inside look_inside(const VoxelGrid& grid, const Bounds& box, const glm::vec3& up,
                   ThreadPool& pool) {
  constexpr float positions = 4096.0f;
  constexpr float enclosed = 0.8f;
  const glm::vec3 extent = glm::max(box.max - box.min, glm::vec3(grid.cell_size()));
  const float step = std::cbrt(extent.x * extent.y * extent.z / positions);
  const glm::ivec3 size = glm::max(glm::ivec3(extent / step), glm::ivec3(1));
  const Explorer explorer(grid, box, up);
  const auto count = static_cast<std::size_t>(size.x * size.y * size.z);
  std::vector<std::optional<Surroundings>> found(count);
  pool.parallel_for(count, [&](std::size_t i) {
    const int k = static_cast<int>(i);
    const glm::ivec3 cell(k % size.x, k / size.x % size.y, k / (size.x * size.y));
    found[i] = explorer.explore(box.min + extent * (glm::vec3(cell) + 0.5f) / glm::vec3(size));
  });
  Inside inside;
  std::vector<InnerView> views;
  for (const auto& around : found) {
    if (!around) continue;
    if (around->enclosure > enclosed) inside.share += 1.0f / static_cast<float>(count);
    if (around->worth <= 0.0f) continue;
    for (int heading = 0; heading < headings; ++heading)
      views.push_back(explorer.view(*around, heading));
  }
  inside.views = pick(std::move(views), 0.1f * explorer.reach());
  return inside;
}

}  // namespace catgs::first_sight
