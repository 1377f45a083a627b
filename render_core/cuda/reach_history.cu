#include "render_core/cuda/reach_history.cuh"

namespace catgs::cuda {

void ReachHistory::reserve(std::uint32_t tiles) {
  if (tiles > reach_[0].size()) forget();
  for (auto& of_frame : reach_) of_frame.reserve(tiles);
}

LastReach ReachHistory::last(const FrameShape& shape, bool same_grid) const {
  if (!known_ || shape_.width_px != shape.width_px || shape_.height_px != shape.height_px)
    return {};
  return {reach_[last_].get(), same_grid,         math::convert<float>(list_from_frame_),
          shape_.first_x_px,   shape_.first_y_px, shape_.tiles_x,
          shape_.tiles_y};
}

void ReachHistory::keep(const FrameShape& shape, const Homography<double>& list_from_frame) {
  last_ = 1 - last_;
  shape_ = shape;
  list_from_frame_ = list_from_frame;
  known_ = true;
}

}  // namespace catgs::cuda
