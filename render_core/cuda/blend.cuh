#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// A run of one tile's list that is blended on its own. Task t is the whole of tile t unless that
/// is split; task shape.tiles() + s is slice s.
struct BlendTask {
  std::uint32_t tile;
  std::uint32_t first, last;  // list entries [first, last)
  std::uint16_t slice;        // number of this run in the tile
  std::uint16_t slices;       // of the tile
};
static_assert(sizeof(BlendTask) == 16);

/// A warp blends one of the 8x8 px parts of a tile. Parts are small enough that most splats of a
/// tile miss most of them, and large enough that loading and testing a splat serves many pixels.
constexpr int part_size_px = 8;
constexpr int parts_per_tile = (tile_size_px / part_size_px) * (tile_size_px / part_size_px);

/// A pixel of the picture.
struct PixelPlace {
  std::uint16_t x, y;
};

/// When the grid is turned against the picture, a tile's pixels are a run. It is blended in parts
/// of part_pixels; the last part takes the rest. Turned tiles have more pixels at the sides that
/// the camera turns to.
constexpr int part_pixels = part_size_px * part_size_px;
constexpr int most_run_parts = 6;

/// Room for the pixels of a tile.
__host__ __device__ inline std::uint32_t run_bound_px(const FrameShape& shape) {
  return static_cast<std::uint32_t>(shape.tile_parts * part_pixels);
}

/// The places where a slice stores a pixel of its tile, and the state of a part.
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
  // Runs of the tiles' pixels, [tiles][run_bound_px(shape)] and [tiles]; null: tiles are squares.
  const PixelPlace* pixels;
  const std::uint32_t* pixel_count;
  // Results of slices. Their pixels, [slice_bound][run_bound_px(shape)]: colour and transmittance
  // as in math::PixelState. Then, both [slice_bound][tile_parts]: one past the last entry looked
  // at, and the largest transmittance that a slice leaves to what lies behind it (1 at first).
  float4* slice_pixels;
  std::uint32_t* consumed;
  float* slice_transmittance;
  std::uint32_t* reach;  // [tiles], zeroed; number of entries that a whole tile looked at
  FrameCounts* counts;   // next_part is consumed; blended_pairs is set when counted
  bool count_pairs;      // slower
  int warps;             // that the device runs at a time, by blend_warps()
};

/// Number of warps of the blend kernel for square tiles that `processors` of the current device run
/// at a time.
int blend_warps(int processors);
void launch_blend(const BlendParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
