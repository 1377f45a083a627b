#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// List entries that one warp sorts; the last run of a tile may be shorter. Measured on one H200
/// with fungi_room, head2: 1,024 entries, twice the keys per lane, cost 2 to 3 % of the frames per
/// second; 256 leave blocks of 18 dB.
constexpr std::uint32_t reorder_run = 512;

struct ReorderRun {
  std::uint32_t first, last;  // one past the last; both within one tile's list
  std::uint16_t continues;    // it follows another run of its tile
  std::uint16_t follows;      // another run of its tile follows it
  std::uint32_t met;  // how many of the two runs that meet at `first` are sorted; 0 at first
};

/// Brings the tile lists of a key frame nearer to the depth order of a sub-frame, in place. A turn
/// of the camera changes the depths in a tile by the same factor, so most entries move only among
/// their neighbours. A warp sorts each run. Where two runs of a tile meet in the wrong order, the
/// warp that finishes last merges the halves that meet. Entries that move farther have already been
/// carried by launch_giants().
struct ReorderParams {
  ReorderRun* runs;  // [counts->runs]
  const FrameCounts* counts;
  const std::uint32_t* depth_key;  // [visible_bound], of this frame
  std::uint32_t* slot;             // [list_bound]
  int processors;                  // of the device
};
void launch_reorder(const ReorderParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
