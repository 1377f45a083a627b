#include "render_core/walk/eye_height.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/scene/analysis/robust_bounds.h"

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

}  // namespace

std::optional<float> estimate_eye_height(const GaussianCloud& sample, const SceneHints& hints) {
  constexpr float usual_share = 0.62f;
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

std::optional<float> eye_height_of(const GaussianCloud& sample, const SceneHints& hints) {
  constexpr float usual_m = 1.6f;
  const float metres = hints.about.metres_per_unit;
  return metres > 0.0f ? usual_m / metres : estimate_eye_height(sample, hints);
}

}  // namespace catgs::walk
