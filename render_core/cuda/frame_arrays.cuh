#pragma once

#include <cstdint>

#include <cuda_fp16.h>

#include "render_core/math/ellipse-inl.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs::cuda {

/// A splat's colour, and half the side of the square around it, px. The colour's rounding alone
/// leaves 77 dB.
struct __align__(8) PackedColour {
  __half2 red_green;
  __half blue;
  __half half_side_px;  // rounded up
};

/// The fields of one projected Gaussian that blending needs: one 32-byte sector.
struct __align__(32) SplatRecord {
  float2 centre_px;
  math::Whitening<float> whitening;
  float log2_opacity;
  PackedColour colour;
};
static_assert(sizeof(SplatRecord) == 32);

/// The blend takes its tasks from this many classes, by their place in the tile's list. The last
/// class has all that are farther back.
constexpr int queue_classes = 8;

/// Counts of a frame. Written by the device, copied to page-locked host memory at the frame's end.
struct FrameCounts {
  // Counts of the key frame, kept by its sub-frames.
  std::uint32_t clusters = 0;      // in sight
  std::uint32_t levels = 0;        // of these, a bit each; only of scenes in pages
  std::uint32_t visible = 0;       // Gaussians in view
  std::uint32_t list_entries = 0;  // sum of all tile lists, before any bound was applied
  std::uint32_t displacement = 0;  // longest path in the window, px, as the bits of a float
  // Counts of each frame.
  std::uint32_t nearness = 0;  // inverted bits of the smallest counted depth; 0: there is none
  std::uint32_t sampled = 0;   // counted Gaussians; inverse_depths is their sum
  std::uint32_t strays = 0;    // sub-frames of catgs: see project.cuh
  unsigned long long inverse_depths = 0;     // in units of 1 / (near_z * inverse_depth_scale)
  std::uint32_t list_max = 0;                // longest tile list
  std::uint32_t queued[queue_classes] = {};  // tasks of the blend; class c begins at c * tiles
  std::uint32_t wanted_slices = 0;           // of long tiles; allocated_slices found room
  std::uint32_t allocated_slices = 0;
  std::uint32_t next_part = 0;              // of a task; next one for a warp of the blend
  unsigned long long expected_entries = 0;  // list entries that tiles are expected to look at
  unsigned long long blended_pairs = 0;     // only when counted; with a pixel's whole last round
};

/// Counts of a key frame that the device writes directly to page-locked host memory as soon as it
/// knows them. Sorting unused room would cost as much as sorting splats.
struct HostCounts {
  std::uint32_t visible = 0;
  std::uint32_t list_entries = 0;
  std::uint32_t strays = 0;  // of a sub-frame, where they are more than most_strays
};

/// Side of the tiles that have lists. A list entry says which of the tile's 8x4 px blocks its splat
/// reaches, so a tile may be large: lists then have few entries to sort.
constexpr int tile_side_px = 32;

/// Width and height of a tile's blocks: a bit each in TileEntry::blocks, row by row.
constexpr int block_width_px = 8;
constexpr int block_height_px = 4;
constexpr int blocks_across = tile_side_px / block_width_px;
constexpr int blocks_down = tile_side_px / block_height_px;
static_assert(blocks_across * blocks_down == 32);

/// An entry of a tile's list.
struct __align__(8) TileEntry {
  std::uint32_t slot;    // of the splat
  std::uint32_t blocks;  // that the splat reaches
};

/// The picture, its grid of tiles, and the bounds of the frame's buffers. Stages count pixels from
/// the grid's corner. The grid of a group with a window is larger than its pictures, and holds each
/// of them somewhere: see TileGrid::follows. Otherwise it is that of the picture.
struct FrameShape {
  int width_px = 0, height_px = 0;            // of the picture
  int left_px = 0, top_px = 0;                // the picture's corner in the grid
  int grid_width_px = 0, grid_height_px = 0;  // what the tiles cover
  int tiles_x = 0, tiles_y = 0;
  std::uint32_t visible_bound = 0;  // room for visible Gaussians
  std::uint32_t list_bound = 0;     // room for list entries
  std::uint32_t slice_bound = 0;    // room for slices of long tiles

  __host__ __device__ std::uint32_t tiles() const {
    return static_cast<std::uint32_t>(tiles_x) * static_cast<std::uint32_t>(tiles_y);
  }
};

constexpr int warp_size = 32;

/// near_z / depth as an integer. A warp's sum fits in 32 bits.
constexpr float inverse_depth_scale = 1 << 20;

constexpr std::uint32_t blocks_for(std::uint32_t threads, std::uint32_t block_size) {
  return (threads + block_size - 1) / block_size;
}

/// Sums of list entries saturate here, so that they fit in 32 bits for any scene.
constexpr std::uint32_t list_entries_limit = std::uint32_t{1} << 31;

}  // namespace catgs::cuda
