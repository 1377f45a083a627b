#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Restores the order of depth in the lists of a sub-frame, which is that of the key frame. A turn
/// of the camera changes it, since depth counts along the view axis. Little changes from frame to
/// frame, so runs of 64 entries are sorted, and the next sub-frame's runs begin in the middle of
/// these. Entries of equal depth keep their order.
struct ListRepairParams {
  FrameShape shape;
  const uint2* range;          // [tiles]
  const std::uint32_t* reach;  // [tiles], the entries that the last frame looked at; null: unknown
  const float* splat_depth;    // [visible_bound], of this frame
  bool shifted;                // runs begin at the 32nd entry of a list
  TileEntry* entries;          // [list_bound]
};
void launch_list_repair(const ListRepairParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
