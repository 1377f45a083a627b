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
/// most parts, large enough that loading and testing a splat serves many pixels.
constexpr int part_size_px = 8;
constexpr int parts_per_tile = (tile_size_px / part_size_px) * (tile_size_px / part_size_px);

/// A pixel of the picture.
struct PixelPlace {
  std::uint16_t x, y;
};

/// The pixels of a tile, where the grid does not lie in the picture: a run that is blended in parts
/// of part_pixels, the last of which takes the rest. Turned tiles have more pixels at the sides
/// that the camera turns to.
constexpr int part_pixels = part_size_px * part_size_px;
constexpr int most_run_parts = 6;

/// Pixels of a tile that there is room for.
__host__ __device__ inline std::uint32_t run_bound_px(const FrameShape& shape) {
  return static_cast<std::uint32_t>(shape.tile_parts * part_pixels);
}

/// Where a slice keeps a pixel of its tile, and what it knows of a part.
__device__ inline std::size_t slice_pixel(const FrameShape& shape, std::uint32_t slice,
                                          int in_tile) {
  return static_cast<std::size_t>(slice) * run_bound_px(shape) + static_cast<unsigned>(in_tile);
}
__device__ inline std::uint32_t slice_part(const FrameShape& shape, std::uint32_t slice, int part) {
  return slice * static_cast<unsigned>(shape.tile_parts) + static_cast<unsigned>(part);
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
  // Runs of the tiles' pixels, [tiles][run_bound_px(shape)] and [tiles]; null: they are squares.
  const PixelPlace* pixels;
  const std::uint32_t* pixel_count;
  // Of slices: their pixels [slice_bound][run_bound_px(shape)], colour and transmittance as in
  // math::PixelState; and [slice_bound][tile_parts], one past the last entry looked at, and 1,
  // then the largest transmittance that a slice leaves to what lies behind.
  float4* slice_pixels;
  std::uint32_t* consumed;
  float* slice_transmittance;
  std::uint32_t* reach;  // [tiles], zeroed; how much of its list a whole tile looked at
  FrameCounts* counts;   // next_part is consumed; blended_pairs is set when counted
  bool count_pairs;      // slower
  int warps;             // that the device holds at a time, by blend_warps()
};

/// Warps of the blend kernel for square tiles that `processors` of the current device hold at a
/// time.
int blend_warps(int processors);
void launch_blend(const BlendParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
