#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// List entries of a window. A block emits a window, and a block sorts one, so that blocks share
/// the lists evenly, whatever a splat's size.
constexpr std::uint32_t list_window = 4096;

/// The sort has a bin for each tile. With more tiles, its bins would not fit in the 99 KB of shared
/// memory that every supported device allows a block.
constexpr std::uint32_t most_sorted_tiles = 2816;

/// Whether a picture has few enough tiles. Others take CUB's radix sort: sort_by_tile().
inline bool sorts_in_one_pass(const FrameShape& shape) {
  return shape.tiles() <= most_sorted_tiles;
}

/// Size of TileSortParams::in_window for this shape, and for all with fewer tiles.
std::size_t window_tiles(const FrameShape& shape);

/// Sorts list entries by tile in one pass: a counting sort. It is stable, so each tile keeps its
/// front-to-back order. CUB's radix sort has bins for 8 bits only, and so takes two passes.
/// Measured on one H200 with fungi_room head1: 5 % more frames than with CUB's sort.
struct TileSortParams {
  FrameShape shape;           // sorts_in_one_pass()
  const FrameCounts* counts;  // list_entries; the host need not know it
  const std::uint16_t* tile;  // [list_bound]; shape.tiles() means no tile
  const TileEntry* unsorted;  // [list_bound]
  std::uint32_t* in_window;   // [windows][tiles], entries of each as launch_emit() counts them;
                              // used up
  TileEntry* entry;           // [list_bound], those of tile t at range[t]
  uint2* range;               // [tiles], {first, one past last} entry
};
void launch_tile_sort(const TileSortParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
