#pragma once

#include "render_core/cuda/blend.cuh"

namespace catgs::cuda {

/// How much of each tile's list the View's last frame looked at. Its grid may lie elsewhere in the
/// picture.
struct LastReach {
  const std::uint32_t* reach = nullptr;  // [tiles of the last grid]; null: unknown; ~0: of a tile
  int tiles_x = 0, tiles_y = 0;
  int2 from_px = {0, 0};  // of this grid's corner in the last one

  /// The most that tiles under this one reach.
  __device__ std::uint32_t under(int column, int row) const {
    const auto tile_at = [](int px) { return px >= 0 ? px / tile_side_px : -1; };
    const int left = column * tile_side_px + from_px.x, top = row * tile_side_px + from_px.y;
    std::uint32_t most = 0;
    if (left >= tiles_x * tile_side_px || top >= tiles_y * tile_side_px || left <= -tile_side_px ||
        top <= -tile_side_px)
      return ~0u;
    for (int y = max(tile_at(top), 0); y <= min(tile_at(top + tile_side_px - 1), tiles_y - 1); ++y)
      for (int x = max(tile_at(left), 0); x <= min(tile_at(left + tile_side_px - 1), tiles_x - 1);
           ++x)
        most = max(most, reach[y * tiles_x + x]);
    return most;
  }
};

/// Cuts long tile lists into slices of about twice the mean length (paper 3.4, Algorithm 1). With l
/// the length of a slice, a tile longer than 2 l becomes ceil(length / l) tasks of equal length.
///
/// Only the part of a list that will be looked at counts as its length: the reach of the tile's
/// pixels in the View's last frame, plus a margin. Most entries lie behind opaque surfaces, and
/// slices of those would be work that an unsplit tile never does. A long rest is cut too, in slices
/// that are drawn last. Most of them then find that nothing shines through what lies before them.
/// For the same reason all first slices are queued before all second ones, and so on. The mean is
/// also the last frame's, so that nothing waits for that of this frame. Blocks of tiles whose
/// slices find no room go without: first without slices of the rest, then without any.
struct SplitParams {
  FrameShape shape;
  const uint2* range;  // [tiles]
  LastReach last_reach;
  std::uint32_t* reach;        // [tiles], set to 0, or ~0 of tiles that are not drawn
  BlendTask* tasks;            // [task_bound(shape)]
  uint2* tile_slices;          // [tiles], first slice and number of slices; 0: one task
  std::uint32_t* queue;        // [queue_bound(shape)], see FrameCounts
  float* slice_transmittance;  // [slice_bound][parts_per_tile], set to 1
  FrameCounts* counts;         // sets the counts of tasks, and list_max
  std::uint32_t mean_list;     // of a tile, for slice_length(); 0: unknown, take this frame's
  bool split;                  // false: every tile is one task
};
void launch_split(const SplitParams& params, cudaStream_t stream);

/// The length of a slice where tiles list `mean` entries on average: two mean lists. The paper uses
/// one. Beginning and ending a part costs as much as a hundred entries, so longer slices are faster
/// (6 % of the blend, measured on one H200 with fungi_room). A slice shorter than four warps'
/// entries is not worth its own pixels.
__host__ __device__ inline std::uint32_t slice_length(std::uint32_t mean) {
  constexpr std::uint32_t shortest = 4 * warp_size;
  return mean > shortest / 2 ? 2 * mean : shortest;
}

inline std::uint32_t task_bound(const FrameShape& shape) {
  return shape.tiles() + shape.slice_bound;
}

/// Room for the queue: one place per tile in all classes but the last.
inline std::uint32_t queue_bound(const FrameShape& shape) {
  return (queue_classes - 1) * shape.tiles() + shape.slice_bound;
}

/// Number of slices that are worth their pixels: twice what the paper's rule can ask for.
inline std::uint32_t most_slices(const FrameShape& shape) { return 4 * shape.tiles(); }

/// Blends the slices of split tiles front to back: C = sum_i C_i prod_{m < i} T_m. Slices behind a
/// finished pixel are not looked at.
struct CompositeParams {
  FrameShape shape;
  const BlendTask* tasks;
  const uint2* tile_slices;
  const float4* slice_pixels;
  const std::uint32_t* consumed;
  const TileEntry* entries;  // as in BlendParams
  PartEnds ends;
  bool loose;  // as in BlendParams
  Finish finish;
  float3 background;
  float* rgb;
  std::uint32_t* reach;  // set for split tiles
};
void launch_composite(const CompositeParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
