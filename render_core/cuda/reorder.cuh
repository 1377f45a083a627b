#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// List entries that one warp sorts; the last run of a tile may be shorter. (One H200, fungi_room,
/// head2: 1,024, for which a lane has to hold twice as many keys, cost 2 to 3 % of the frames a
/// second; 256 leave blocks of 18 dB.)
constexpr std::uint32_t reorder_run = 512;

struct ReorderRun {
  std::uint32_t first, last;  // one past the last; both within one tile's list
  std::uint16_t continues;    // whether it follows another run of its tile, the one before it
  std::uint16_t follows;      // whether another comes after it
  std::uint32_t met;  // how many of the two runs that meet at `first` are in order; 0 at first
};

/// Brings the tile lists that a sub-frame takes over from its key frame nearer to its own depth
/// order, in place. A turn of the camera changes the depths in a tile by one and the same share, so
/// that most entries move among their neighbours: each run is sorted by a warp, and where two runs
/// of a tile meet in the wrong order, whoever is ready last merges the halves that meet. What
/// belongs farther away launch_giants() has carried there.
struct ReorderParams {
  ReorderRun* runs;  // [counts->runs]
  const FrameCounts* counts;
  const std::uint32_t* depth_key;  // [visible_bound], of this frame
  std::uint32_t* slot;             // [list_bound]
  int processors;                  // of the device
};
void launch_reorder(const ReorderParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
