#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Brings the tile lists that a sub-frame takes over from its key frame nearer to its own depth
/// order, in place. Of most entries the order changes little from frame to frame: a turn moves the
/// depths in a tile by one and the same share. They move within a window of neighbours that slides
/// along a run of the list; what one lacks, the next frame adds, whose runs begin elsewhere. Large
/// Gaussians with centres elsewhere may jump over hundreds of these: before, each tile is combed
/// (Shell's sort with one stride), which takes every entry near to its place. Only what the tiles
/// are expected to look at is in the runs, and somewhat more is combed.
struct ReorderParams {
  FrameShape shape;
  const uint2* range;           // [tiles]
  const std::uint32_t* combed;  // [tiles], entries of each list that are combed
  const uint2* runs;  // [counts->runs], first and one past the last entry, each within a tile
  const FrameCounts* counts;
  const std::uint32_t* depth_key;  // [visible_bound], of this frame
  std::uint32_t* slot;             // [list_bound]
  int processors;                  // of the device
};
void launch_reorder(const ReorderParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
