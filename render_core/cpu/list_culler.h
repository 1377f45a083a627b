#pragma once

#include "render_core/motion/frame_groups.h"
#include "render_core/scene/clusters.h"

namespace catgs {

/// Which clusters the lists of a key frame need: those that may reach its grid, for any camera of
/// its guard set.
class ListCuller {
 public:
  ListCuller(const Camera& camera, const FramePlan& plan);
  [[nodiscard]] bool outside(const Cluster& cluster) const;

 private:
  [[nodiscard]] Cluster grown(const Cluster& cluster) const;
  [[nodiscard]] bool turns_in(const Cluster& cluster, const Pose& pose) const;

  ClusterCuller now_, end_;
  Pose start_, window_end_;
  ListGrowth<float> growth_;
  glm::vec3 position_, forward_;  // world
  float near_z_, focal_px_;
  float parallax_;          // world units that a camera of the guard set may be off
  float curvature_, wide_;  // ListGrowth
};

}  // namespace catgs
