#pragma once

#include "render_core/math/growth-inl.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/scene/clusters.h"

namespace catgs {

/// Finds the clusters that a key frame's lists need: those that may reach its grid, for any camera
/// of its guard set.
class ListCuller {
 public:
  ListCuller(const Camera& camera, const FramePlan& plan);

  [[nodiscard]] CATGS_HD bool outside(const Cluster& cluster) const {
    return outside_on_the_way(now_, end_, grown(cluster)) && !turns_in(cluster, start_) &&
           !turns_in(cluster, window_end_);
  }

 private:
  /// An end of the camera's path: its position and axes, world.
  struct End {
    explicit End(const Pose& pose);
    glm::vec3 position, right, down, forward;
  };

  [[nodiscard]] CATGS_HD static math::Vec3<float> seen_from(const End& end,
                                                            const glm::vec3& point) {
    const math::Vec3<float> offset{point.x - end.position.x, point.y - end.position.y,
                                   point.z - end.position.z};
    const auto along = [&](const glm::vec3& axis) {
      return math::dot<float>({axis.x, axis.y, axis.z}, offset);
    };
    return {along(end.right), along(end.down), along(end.forward)};
  }

  /// math::may_turn_in() of any Gaussian in the cluster that is behind the near plane. The
  /// half-spaces decide about Gaussians in front of it.
  [[nodiscard]] CATGS_HD bool turns_in(const Cluster& cluster, const End& end) const {
    const float nearest = nearest_depth(end, cluster);
    const glm::vec3& at = end.position;
    const float rounding = 1e-5f * (fabsf(at.x) + fabsf(at.y) + fabsf(at.z) + fabsf(nearest));
    if (nearest > near_z_ + rounding) return false;
    const glm::vec3& half = cluster.half_extent;
    const float radius = sqrtf(half.x * half.x + half.y * half.y + half.z * half.z);
    return math::may_turn_in<float>(growth_, seen_from(end, cluster.centre),
                                    cluster.reach + radius * (1.0f + growth_.steepest),
                                    near_z_ - radius * (growth_.turn_cosine + growth_.turn_sine));
  }

  [[nodiscard]] CATGS_HD static float nearest_depth(const End& end, const Cluster& cluster) {
    const glm::vec3& half = cluster.half_extent;
    return seen_from(end, cluster.centre).z - fabsf(end.forward.x) * half.x -
           fabsf(end.forward.y) * half.y - fabsf(end.forward.z) * half.z;
  }

  /// math::growth_px() as a longer reach: larger by the camera's distance off its path, and by
  /// shares of the splats' radii.
  [[nodiscard]] CATGS_HD Cluster grown(const Cluster& cluster) const {
    const float nearest =
        fminf(nearest_depth(start_, cluster), nearest_depth(window_end_, cluster));
    const float radius_px = focal_px_ * cluster.reach / fmaxf(nearest, near_z_);
    Cluster result = cluster;
    result.reach *= 1.0f + growth_.wide + growth_.curvature * radius_px;
    result.reach += off_path_;
    return result;
  }

  ClusterCuller now_, end_;
  End start_, window_end_;
  ListGrowth<float> growth_;
  float near_z_;
  float focal_px_;  // enlarged so that it bounds a splat's radius at the sides too
  float off_path_;  // world units that a camera of the guard set may be off its path, enlarged
                    // likewise
};

}  // namespace catgs
