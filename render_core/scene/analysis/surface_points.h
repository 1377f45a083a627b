#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// What a ray meets first, whatever core renders the scene: its Gaussians as balls, of large scenes
/// an even sample with balls that are larger for it. For pointing at things, not for pictures.
class SurfacePoints {
 public:
  /// Keeps at most `max_points` (20 bytes each).
  SurfacePoints(const GaussianCloud& cloud, ThreadPool& pool,
                std::size_t max_points = std::size_t{1} << 20);

  /// Distance from `origin` along the unit vector `direction` at which half of the light is
  /// stopped; nothing where less is. Looks at one ball for each cluster_size points, and at the
  /// points of those that the ray meets.
  [[nodiscard]] std::optional<float> distance_along(const glm::vec3& origin,
                                                    const glm::vec3& direction) const;

 private:
  struct Ball {
    glm::vec3 centre{0.0f};
    float radius = 0.0f;
  };
  struct Point {
    glm::vec3 centre;
    float sigma;  // standard deviation
    float opacity;
  };
  [[nodiscard]] std::span<const Point> points_of(std::size_t cluster) const;
  static Ball around(std::span<const Point> points);

  std::vector<Point> points_;   // along a Morton curve
  std::vector<Ball> clusters_;  // around all that is to be seen of cluster_size points each
};

}  // namespace catgs
