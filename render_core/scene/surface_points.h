#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// What a ray meets first, whatever core renders the scene: its Gaussians as balls, of large scenes
/// an even sample with balls that are larger for it. For pointing at things, not for pictures.
class SurfacePoints {
 public:
  /// Keeps at most `max_points` (20 bytes each).
  explicit SurfacePoints(const GaussianCloud& cloud, std::size_t max_points = std::size_t{1} << 20);

  /// Distance from `origin` along the unit vector `direction` at which half of the light is
  /// stopped; nothing where less is. O(points); 2 ms for a million.
  [[nodiscard]] std::optional<float> distance_along(const glm::vec3& origin,
                                                    const glm::vec3& direction) const;

 private:
  std::vector<glm::vec3> centre_;
  std::vector<float> radius_;  // standard deviation
  std::vector<float> opacity_;
};

}  // namespace catgs
