#pragma once

#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/split.cuh"

namespace catgs::cuda {

/// How much of each tile's list a View's last frame looked at, and where those tiles were. The next
/// frame expects the same.
class ReachHistory {
 public:
  /// Takes two buffers, [tiles] each, which alternate and outlive the history.
  ReachHistory(const DeviceBuffer<std::uint32_t>& a, const DeviceBuffer<std::uint32_t>& b)
      : reach_{&a, &b} {}

  void forget() { known_ = false; }

  /// The reach of the last frame, for a frame of this shape; empty where the picture had another
  /// size. `same_grid`: both frames have the lists of one key frame.
  [[nodiscard]] LastReach last(const FrameShape& shape, bool same_grid) const;
  /// [tiles], output of the current frame.
  [[nodiscard]] std::uint32_t* current() const { return reach_[1 - last_]->get(); }
  /// Call when the frame is drawn. Its pixels found their tiles by `list_from_frame`.
  void keep(const FrameShape& shape, const Homography<double>& list_from_frame);

 private:
  const DeviceBuffer<std::uint32_t>* reach_[2];
  bool known_ = false;
  int last_ = 0;
  FrameShape shape_;
  Homography<double> list_from_frame_{};
};

}  // namespace catgs::cuda
