#include "render_core/scene/surface_points.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <glm/geometric.hpp>

namespace catgs {
namespace {

/// Of a disc with the area that the Gaussian covers when it is seen from its broad side.
float disc_radius(const glm::vec3& scale) {
  const float smallest = std::min({scale.x, scale.y, scale.z});
  const float product = scale.x * scale.y * scale.z;
  return std::sqrt(product / std::max(smallest, 1e-12f));
}

}  // namespace

SurfacePoints::SurfacePoints(const GaussianCloud& cloud, std::size_t max_points) {
  const std::size_t step = std::max<std::size_t>(
      1, (cloud.size() + max_points - 1) / std::max<std::size_t>(1, max_points));
  const float growth = std::sqrt(static_cast<float>(step));  // of the discs that stand for `step`
  const std::size_t count = (cloud.size() + step - 1) / step;
  centre_.reserve(count);
  radius_.reserve(count);
  opacity_.reserve(count);
  // One out of each `step`, not always the same: many files are ordered row by row.
  std::uint32_t lot = 1;
  for (std::size_t first = 0; first < cloud.size(); first += step) {
    lot = lot * 1664525u + 1013904223u;
    const std::size_t i = std::min(first + (lot >> 8) % step, cloud.size() - 1);
    centre_.push_back(cloud.mean[i]);
    radius_.push_back(growth * disc_radius(cloud.scale[i]));
    opacity_.push_back(cloud.opacity[i]);
  }
}

std::optional<float> SurfacePoints::distance_along(const glm::vec3& origin,
                                                   const glm::vec3& direction) const {
  std::vector<std::pair<float, float>> stops;  // distance, alpha
  for (std::size_t i = 0; i < centre_.size(); ++i) {
    const glm::vec3 offset = centre_[i] - origin;
    const float along = glm::dot(offset, direction);
    const float beside2 = glm::dot(offset, offset) - along * along;
    const float radius2 = radius_[i] * radius_[i];
    // Beyond three standard deviations there is nothing to see; and nobody points at what the
    // camera stands in.
    if (along <= radius_[i] || beside2 > 9.0f * radius2) continue;
    stops.emplace_back(along, opacity_[i] * std::exp(-0.5f * beside2 / radius2));
  }
  std::ranges::sort(stops);
  float left = 1.0f;
  for (const auto& [distance, alpha] : stops) {
    left *= 1.0f - alpha;
    if (left <= 0.5f) return distance;
  }
  return std::nullopt;
}

}  // namespace catgs
