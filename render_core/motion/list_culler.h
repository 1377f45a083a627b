#pragma once

#include "render_core/motion/frame_groups.h"
#include "render_core/scene/clusters.h"

namespace catgs {

/// Which clusters the lists of a key frame need: those that may reach its grid, for any camera of
/// its guard set.
class ListCuller {
 public:
  ListCuller(const Camera& camera, const FramePlan& plan);

  [[nodiscard]] CATGS_HD bool outside(const Cluster& cluster) const {
    return outside_on_the_way(now_, end_, grown(cluster));
  }

 private:
  /// growth_px() as a longer reach: by the camera's way off, and by shares of the splats' radii.
  [[nodiscard]] CATGS_HD Cluster grown(const Cluster& cluster) const {
    const float depth =
        forward_.x * (cluster.centre.x - position_.x) - fabsf(forward_.x) * cluster.half_extent.x +
        forward_.y * (cluster.centre.y - position_.y) - fabsf(forward_.y) * cluster.half_extent.y +
        forward_.z * (cluster.centre.z - position_.z) - fabsf(forward_.z) * cluster.half_extent.z;
    const float radius_px = focal_px_ * cluster.reach / fmaxf(depth, near_z_);
    Cluster result = cluster;
    result.reach = cluster.reach * (1.0f + wide_ + curvature_ * radius_px) + parallax_;
    return result;
  }

  ClusterCuller now_, end_;
  glm::vec3 position_, forward_;  // world
  float near_z_;
  float focal_px_;          // and so much more that it bounds a splat's radius at the sides
  float parallax_;          // world units that a camera of the guard set may be off
  float curvature_, wide_;  // ListGrowth
};

}  // namespace catgs
