#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// A run of one tile's list that is blended on its own: task t is the whole of tile t where that is
/// not split, task shape.tiles() + s is slice s of those that are.
struct BlendTask {
  std::uint32_t tile;
  std::uint32_t first, last;  // list entries [first, last)
  std::uint16_t slice;        // place of this run among the tile's
  std::uint16_t slices;       // of the tile
};
static_assert(sizeof(BlendTask) == 16);

/// A warp blends one of the 8x8 px parts of a tile: small enough that most splats of a tile miss
/// most parts, large enough that two pixels a lane share what does not depend on the pixel.
constexpr int part_size_px = 8;
constexpr int parts_per_tile = (tile_size_px / part_size_px) * (tile_size_px / part_size_px);

/// Part of a pixel of a tile.
__device__ inline int part_of(int in_tile_x, int in_tile_y) {
  return in_tile_y / part_size_px * (tile_size_px / part_size_px) + in_tile_x / part_size_px;
}

/// Where a slice keeps a pixel of its tile.
__device__ inline std::size_t slice_pixel(std::uint32_t slice, int in_tile_x, int in_tile_y) {
  return (static_cast<std::size_t>(slice) * tile_size_px + in_tile_y) * tile_size_px + in_tile_x;
}

/// Blends all tasks front to back. Whole tiles go straight to the image, slices to slice_pixels.
struct BlendParams {
  FrameShape shape;
  const SplatRecord* records;
  const std::uint32_t* slot;   // [list_bound], sorted by tile, front to back within one
  const BlendTask* tasks;      // [task_bound(shape)]
  const std::uint32_t* queue;  // [queue_bound(shape)], tasks by class
  float3 background;
  float* rgb;  // [height][width][3], display-referred, in [0, 1]
  // Of slices: their pixels [slice_bound][tile_size_px^2], colour and transmittance as in
  // math::PixelState; and [slice_bound][parts_per_tile], one past the last entry looked at, and 1,
  // then the largest transmittance that a slice leaves to what lies behind.
  float4* slice_pixels;
  std::uint32_t* consumed;
  float* slice_transmittance;
  std::uint32_t* reach;  // [tiles], zeroed; how much of its list a whole tile looked at
  FrameCounts* counts;   // next_part is consumed; blended_pairs is set when counted
  bool count_pairs;      // slower
  int warps;             // that the device holds at a time, by blend_warps()
};

/// Warps of the blend kernel that `processors` of the current device hold at a time.
int blend_warps(int processors);
void launch_blend(const BlendParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
