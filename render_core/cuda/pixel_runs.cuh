#pragma once

#include "render_core/cuda/blend.cuh"
#include "render_core/math/homography-inl.h"

namespace catgs::cuda {

/// Finds the pixels of each tile of a grid that is turned with the camera (GridKind::warp): pixel p
/// of the picture belongs to the tile that holds list_from_frame(p). Every pixel is in one run. A
/// run follows a Hilbert curve in the grid, so that any part of it is compact.
struct PixelRunParams {
  FrameShape shape;
  Homography<float> list_from_frame;  // picture px -> px of the lists' image plane
  Homography<float> frame_from_list;
  PixelPlace* pixels;          // [tiles][run_bound_px(shape)]
  std::uint32_t* pixel_count;  // [tiles]
};
void launch_pixel_runs(const PixelRunParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
