#pragma once

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/occlusion.cuh"
#include "render_core/cuda/tile_sort.cuh"
#include "render_core/cuda/tiles.cuh"

namespace catgs::cuda {

// Tile: std::uint16_t or std::uint32_t, whichever can hold shape.tiles(). The narrow type saves a
// sixth of the bytes that sorting moves.

/// Writes the tile list entries of all visible splats in depth order.
template <class Tile>
struct EmitParams {
  FrameShape shape;
  const FrameCounts* counts;
  const SplatRecord* records;
  const std::uint32_t* order;       // [visible_bound], slots front to back
  const std::uint32_t* first;       // [visible_bound], the first entry of the k-th splat
  const std::uint32_t* tile_count;  // [visible_bound], by slot
  const TileSpans* spans;           // [visible_bound], by slot
  const SplatPath* path;            // [visible_bound], by slot; null: splats do not move
  ListSlack slack;                  // of paths
  Occlusion occlusion;
  const float* splat_depth;  // [visible_bound], by slot; null: no occlusion and no slack
  std::uint32_t* in_window;  // TileSortParams::in_window; null: not wanted
  Tile* tile;                // [list_bound], tile index; shape.tiles() means no tile
  TileEntry* entry;          // [list_bound]
};
template <class Tile>
void launch_emit(const EmitParams<Tile>& params, cudaStream_t stream);

/// range[t] = {first, one past last} list entry of tile t; {0, 0} for a tile without entries.
template <class Tile>
struct RangesParams {
  FrameShape shape;
  std::uint32_t entries;
  const Tile* tile;  // [entries], sorted
  uint2* range;      // [tiles]
};
template <class Tile>
void launch_ranges(const RangesParams<Tile>& params, cudaStream_t stream);

}  // namespace catgs::cuda
