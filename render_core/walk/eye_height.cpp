#include "render_core/walk/eye_height.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <span>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/scene/analysis/voxel_grid.h"
#include "render_core/walk/grid.h"

namespace catgs::walk {
namespace {

constexpr std::size_t bins = 64;  // from the start upwards or downwards

struct Peak {
  float distance = 0.0f;  // bins
  float area = 0.0f;
};

Peak peak_of(std::span<const float> area) {
  const auto highest = std::ranges::max_element(area) - area.begin();
  Peak peak;
  for (auto k = std::max<std::ptrdiff_t>(0, highest - 1);
       k < std::min<std::ptrdiff_t>(highest + 2, bins); ++k) {
    peak.area += area[static_cast<std::size_t>(k)];
    peak.distance += area[static_cast<std::size_t>(k)] * (static_cast<float>(k) + 0.5f);
  }
  peak.distance /= std::max(peak.area, 1e-30f);
  return peak;
}

constexpr float usual_share = 0.62f;

/// By the heights at which most level Gaussians lie around the start, below and above it. Empty
/// where there is no floor, or little of a ceiling.
std::optional<float> height_at_start(const GaussianCloud& sample, const SceneHints& hints) {
  constexpr float level = 0.9f;           // cosine
  constexpr float little = 0.2f;          // of the floor's area
  constexpr float around = 0.2f;          // of the scene's size
  constexpr float largest_share = 0.02f;  // of that; a background would outvote all others
  const auto core = robust_bounds(sample, 0.02f);
  if (!core) return std::nullopt;
  const float size = glm::distance(core->min, core->max), largest = largest_share * size;
  const float bin = size / static_cast<float>(bins);
  std::array<float, bins> below{}, above{};
  for (std::size_t i = 0; i < sample.size(); ++i) {
    const glm::vec3& scale = sample.scale[i];
    std::array<int, 3> axes = {0, 1, 2};
    std::ranges::sort(axes, [&](int a, int b) { return scale[a] < scale[b]; });
    const glm::vec3 normal = glm::mat3_cast(sample.rotation[i])[axes[0]];
    const glm::vec3 way = sample.mean[i] - hints.start_pose.position;
    const float height = glm::dot(way, hints.up);
    const auto k = static_cast<std::size_t>(std::min(std::abs(height) / bin, 1e6f));
    if (std::abs(glm::dot(normal, hints.up)) < level || k >= bins ||
        glm::length(way - height * hints.up) > around * size)
      continue;
    (height < 0.0f ? below : above)[k] +=
        sample.opacity[i] * std::min(scale[axes[1]], largest) * std::min(scale[axes[2]], largest);
  }
  const Peak floor = peak_of(below), ceiling = peak_of(above);
  if (!(floor.area > 0.0f && ceiling.area > little * floor.area)) return std::nullopt;
  return usual_share * bin * (floor.distance + ceiling.distance);
}

struct Rooms {
  float height = 0.0f;
  int columns = 0;
};

/// The heights of rooms, by what stops the light above and below points in free space: those of
/// most area first.
std::vector<float> heights_of_rooms(const GaussianCloud& sample, const SceneHints& hints) {
  constexpr int columns = 64, levels = 32;    // of points
  constexpr float bins_per_e = 12.0f;         // of the logarithm of the height
  constexpr float free_optical_depth = 0.2f;  // of the cells around a point
  constexpr int few = 20;                     // times fewer columns than those with rooms
  const auto core = robust_bounds(sample, 0.02f);
  if (!core) return {};
  const glm::vec3 extent = core->max - core->min, middle = core->min + 0.5f * extent;
  const VoxelGrid grid(sample, {core->min - 0.1f * extent, core->max + 0.1f * extent});
  const glm::mat3 axes = grid_around(middle, hints.up, 1.0f).axes;
  const auto at = [&](int k, int n) {
    return glm::length(extent) * ((static_cast<float>(k) + 0.5f) / static_cast<float>(n) - 0.5f);
  };
  std::map<int, Rooms> by_height;
  int with_rooms = 0;
  for (int c = 0; c < columns * columns; ++c) {
    std::set<int> here;  // a height counts once a column
    for (int level = 0; level < levels; ++level) {
      const glm::vec3 point =
          middle +
          axes * glm::vec3(at(c % columns, columns), at(c / columns, columns), at(level, levels));
      if (glm::clamp(point, core->min, core->max) != point ||
          grid.depth_around(point) > free_optical_depth)
        continue;
      const float height =
          grid.distance_along(point, hints.up) + grid.distance_along(point, -hints.up);
      const int bin = height == VoxelGrid::never
                          ? 0
                          : static_cast<int>(std::floor(bins_per_e * std::log(height)));
      if (height == VoxelGrid::never || !here.insert(bin).second) continue;
      Rooms& rooms = by_height[bin];
      rooms.height += height;
      ++rooms.columns;
    }
    with_rooms += here.empty() ? 0 : 1;
  }
  std::vector<Rooms> rooms;
  while (!by_height.empty()) {
    const auto most = std::ranges::max_element(
        by_height, {}, [](const auto& entry) { return entry.second.columns; });
    const int middle_bin = most->first;
    Rooms all;
    for (int bin = middle_bin - 1; bin <= middle_bin + 1; ++bin)
      if (const auto found = by_height.find(bin); found != by_height.end()) {
        all.height += found->second.height;
        all.columns += found->second.columns;
      }
    if (few * all.columns < std::max(with_rooms, columns)) break;
    rooms.push_back(all);
    for (int bin = middle_bin + 1; bin >= middle_bin - 1; --bin) by_height.erase(bin);
  }
  std::vector<float> heights;
  for (const Rooms& some : rooms) heights.push_back(some.height / static_cast<float>(some.columns));
  return heights;
}

}  // namespace

std::vector<float> eye_heights_of(const GaussianCloud& sample, const SceneHints& hints) {
  constexpr float usual_m = 1.6f, alike = 0.1f;
  constexpr std::size_t most = 3;
  const float metres = hints.about.metres_per_unit;
  if (metres > 0.0f) return {usual_m / metres};
  std::vector<float> heights;
  const auto add = [&](float height) {
    const bool is_new = std::ranges::none_of(
        heights, [&](float other) { return std::abs(height - other) < alike * other; });
    if (is_new && heights.size() < most) heights.push_back(height);
  };
  const std::vector<float> rooms = heights_of_rooms(sample, hints);
  const std::optional<float> at_start = height_at_start(sample, hints);
  for (std::size_t k = 0; k < std::min(rooms.size(), at_start ? most - 1 : most); ++k)
    add(usual_share * rooms[k]);
  if (at_start) add(*at_start);
  return heights;
}

}  // namespace catgs::walk
