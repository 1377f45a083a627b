#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// The surface that a ray meets first. For pointing at things, not for pictures, so it does not
/// depend on the core. Gaussians count as balls; a large scene is an even sample of them with balls
/// enlarged to match.
class SurfacePoints {
 public:
  /// Keeps at most `max_points` (20 bytes each).
  SurfacePoints(const GaussianCloud& cloud, ThreadPool& pool,
                std::size_t max_points = std::size_t{1} << 20);

  struct Hit {
    float distance;  // from the origin to where half of the light is stopped, world units
    float spread;    // half of the way on which the middle 68 % of the light are stopped
  };
  /// Finds what a ray from `origin` along the unit vector `direction` meets; empty where less than
  /// half of the light is stopped. Looks at one ball for each cluster_size points, and at the
  /// points of the clusters that the ray meets.
  [[nodiscard]] std::optional<Hit> hit_along(const glm::vec3& origin,
                                             const glm::vec3& direction) const;
  /// The share of the light that comes from so far along the ray to its origin, or any share below
  /// `enough`. Faster than hit_along().
  [[nodiscard]] float light_from(const glm::vec3& origin, const glm::vec3& direction,
                                 float distance, float enough) const;

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
  /// Calls `visit(distance, alpha)` for the points that the ray meets before `farthest`, cluster by
  /// cluster, until it returns false.
  template <typename Visit>
  void for_points_on(const glm::vec3& origin, const glm::vec3& direction, float farthest,
                     const Visit& visit) const;
  static Ball around(std::span<const Point> points);

  std::vector<Point> points_;   // along a Morton curve
  std::vector<Ball> clusters_;  // each holds cluster_size points and all that is visible of them
};

}  // namespace catgs
