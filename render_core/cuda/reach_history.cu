#include "render_core/cuda/reach_history.cuh"

namespace catgs::cuda {

LastReach ReachHistory::last(const FrameShape& shape, bool same_grid) const {
  if (!known_ || shape_.width_px != shape.width_px || shape_.height_px != shape.height_px)
    return {};
  return {.reach = reach_[last_]->get(),
          .same_grid = same_grid,
          .list_from_frame = math::convert<float>(list_from_frame_),
          .first_x_px = shape_.first_x_px,
          .first_y_px = shape_.first_y_px,
          .tiles_x = shape_.tiles_x,
          .tiles_y = shape_.tiles_y};
}

void ReachHistory::keep(const FrameShape& shape, const Homography<double>& list_from_frame) {
  last_ = 1 - last_;
  shape_ = shape;
  list_from_frame_ = list_from_frame;
  known_ = true;
}

}  // namespace catgs::cuda
