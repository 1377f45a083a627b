#pragma once

#include "render_core/motion/frame_groups.h"
#include "render_core/scene/clusters.h"

namespace catgs {

/// Finds the clusters that a key frame's lists need: those that may reach the picture on the way to
/// its window's end.
class ListCuller {
 public:
  /// The picture is taken to be wider by `margin_px` on all sides.
  ListCuller(const Camera& camera, const FramePlan& plan, int margin_px = 0)
      : now_(padded(camera, margin_px)), end_(padded(plan.window_end, margin_px)) {}

  [[nodiscard]] CATGS_HD bool outside(const Cluster& cluster) const {
    return outside_on_the_way(now_, end_, cluster);
  }

 private:
  ClusterCuller now_, end_;
};

}  // namespace catgs
