#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Brings the tile lists that a sub-frame takes over from its key frame nearer to its own depth
/// order, in place. The order changes little from frame to frame, so that an entry moves within a
/// window of neighbours that slides along a run of the list; what it lacks, the next frame adds,
/// whose runs begin elsewhere. Only what the tiles are expected to look at is in the runs.
struct ReorderParams {
  const uint2* runs;  // [counts->runs], first and one past the last entry, each within a tile
  const FrameCounts* counts;
  const std::uint32_t* depth_key;  // [visible_bound], of this frame
  std::uint32_t* slot;             // [list_bound]
  int processors;                  // of the device
};
void launch_reorder(const ReorderParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
