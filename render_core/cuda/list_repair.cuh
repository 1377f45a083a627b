#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Restores the order of depth in the lists of a sub-frame, which is that of the key frame. A turn
/// of the camera changes it, since depth counts along the view axis. Runs of 64 entries are sorted,
/// then the 64 around each of their ends. So the order is whole where no entry is more than 32 from
/// where it belongs: a list that is sorted by runs, each off by at most half a run, has all that
/// belongs elsewhere in the halves that are merged. What is farther off comes closer with each
/// sub-frame. Entries of equal depth keep their order.
struct ListRepairParams {
  FrameShape shape;
  const uint2* range;          // [tiles]
  const std::uint32_t* reach;  // [tiles], the entries that the last frame looked at; null: unknown
  const float* splat_depth;    // [visible_bound], of this frame
  TileEntry* entries;          // [list_bound]
};
void launch_list_repair(const ListRepairParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
