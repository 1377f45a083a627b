#pragma once

#include <cmath>

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/pixel.cuh"

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

/// A warp blends one of the 8x8 px parts of a tile, in two halves that are blocks. Parts are small
/// enough that most splats of a tile miss most of them, and large enough that loading a splat
/// serves many pixels.
constexpr int part_side_px = 8;
constexpr int halves = part_side_px / block_height_px;
constexpr int parts_across = tile_side_px / part_side_px;
constexpr int parts_per_tile = parts_across * parts_across;
constexpr int part_pixels = part_side_px * part_side_px;
static_assert(block_width_px == part_side_px && halves == 2);

/// TileEntry::blocks of half 0 of a part; those of half 1 follow in the next row of blocks.
__host__ __device__ constexpr std::uint32_t first_block_of(int part) {
  return 1u << (part / parts_across * halves * blocks_across + part % parts_across);
}
__host__ __device__ constexpr std::uint32_t blocks_of(int part) {
  return first_block_of(part) * (1u + (1u << blocks_across));
}

/// Numbers of a tile's pixels: part by part, and row by row in a part.
constexpr int tile_pixels = tile_side_px * tile_side_px;

/// The top left pixel of a part, px in the picture.
__device__ inline int2 part_corner_px(const FrameShape& shape, std::uint32_t tile, int part) {
  const int index = static_cast<int>(tile);
  return make_int2(index % shape.tiles_x * tile_side_px + part % parts_across * part_side_px,
                   index / shape.tiles_x * tile_side_px + part / parts_across * part_side_px);
}

/// The place in an array [tiles][parts_per_tile] of the part in this column and row of all parts.
__device__ inline std::uint32_t part_position(const FrameShape& shape, int column, int row) {
  const int tile = row / parts_across * shape.tiles_x + column / parts_across;
  const int in_tile = row % parts_across * parts_across + column % parts_across;
  return static_cast<std::uint32_t>(tile * parts_per_tile + in_tile);
}

/// The places where a slice stores a pixel of its tile, and the state of a part.
__device__ inline std::size_t slice_pixel(std::uint32_t slice, int in_tile) {
  return static_cast<std::size_t>(slice) * tile_pixels + static_cast<unsigned>(in_tile);
}
__device__ inline std::uint32_t slice_part(std::uint32_t slice, int part) {
  return slice * static_cast<unsigned>(parts_per_tile) + static_cast<unsigned>(part);
}

/// Where parts end: the view depth of the last splat that a part looked at until all its pixels
/// were finished; infinity where some are not. No splat behind it shows.
struct PartEnds {
  const float* splat_depth;  // [visible_bound]
  float* depth;              // [tiles][parts_per_tile]; null: not wanted

  __device__ void note(std::uint32_t tile, int part, float end) const {
    depth[tile * parts_per_tile + static_cast<unsigned>(part)] = end;
  }
};

/// Lists of a group with a window hold more than its frames show, and in sub-frames their order is
/// only nearly that of depth. The end of a part is then the deepest of so many last entries.
constexpr unsigned loose_end_entries = 32;

/// Blends all tasks front to back. Whole tiles go straight to the image, slices to slice_pixels.
struct BlendParams {
  FrameShape shape;
  const SplatRecord* records;
  const TileEntry* entries;    // [list_bound], sorted by tile, front to back within one
  const BlendTask* tasks;      // [task_bound(shape)]
  const std::uint32_t* queue;  // [queue_bound(shape)], tasks by class
  float3 background;
  float* rgb;  // [height][width][3], display-referred, in [0, 1]
  // Results of slices. Their pixels, [slice_bound][tile_pixels]: colour and transmittance as in
  // math::PixelState. Then, both [slice_bound][parts_per_tile]: one past the last entry looked at,
  // and the largest transmittance that a slice leaves to what lies behind it (1 at first).
  float4* slice_pixels;
  std::uint32_t* consumed;
  float* slice_transmittance;
  PartEnds ends;
  Finish finish;
  std::uint32_t* reach;  // [tiles], zeroed; number of entries that a whole tile looked at
  FrameCounts* counts;   // next_part is consumed; blended_pairs is set when counted
  bool loose;            // lists of a group with a window
  bool count_pairs;      // slower
  int warps;             // that the device runs at a time, by blend_warps()
};

/// Number of warps of the blend kernel that `processors` of the current device run
/// at a time.
int blend_warps(int processors);
void launch_blend(const BlendParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
