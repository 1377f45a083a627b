#pragma once

#include "render_core/cuda/blend.cuh"
#include "render_core/math/occlusion-inl.h"

namespace catgs::cuda {

/// The depths behind which nothing shows, expected from the View's last frame. Splats behind them
/// are not drawn.
struct Occlusion {
  const float* part = nullptr;   // [tiles][parts_per_tile], view depth; null: nothing is hidden
  const float2* tile = nullptr;  // [tiles], the smallest and the largest of a tile

  /// Whether a splat with this box, px in the grid, is behind the limits of all parts it meets.
  __device__ bool hides(const FrameShape& shape, float2 low_px, float2 high_px, float depth) const;
};

/// The part of a frame that occlusion needs in the next one.
struct LastPicture {
  math::CameraModel<float> camera;  // draws into its grid
  FrameShape shape;
};

/// Carries the ends of parts (see PartEnds) over to the next frame: math::occlusion_limit(). With a
/// window, nothing is hidden that shows at its start or at its end.
struct OcclusionParams {
  FrameShape shape;
  math::CameraModel<float> now, end;  // draw into the frame's grid; equal without a window
  bool sweeps;                        // with a window
  int4 shown;                         // box of all pictures of the window, px: low x, y, high x, y
  LastPicture last;
  int radius;              // math::occlusion_radius(), not negative
  const float* last_ends;  // [tiles of last][parts_per_tile]
  float* part;             // [tiles][parts_per_tile], Occlusion::part
  float2* tile;            // [tiles], Occlusion::tile
};
void launch_occlusion(const OcclusionParams& params, cudaStream_t stream);

__device__ inline bool Occlusion::hides(const FrameShape& shape, float2 low_px, float2 high_px,
                                        float depth) const {
  if (part == nullptr) return false;
  const int last_x = shape.grid_width_px - 1, last_y = shape.grid_height_px - 1;
  const int left = max(0, static_cast<int>(low_px.x)),
            right = min(last_x, static_cast<int>(high_px.x));
  const int top = max(0, static_cast<int>(low_px.y)),
            bottom = min(last_y, static_cast<int>(high_px.y));
  // Few limits decide about most splats. Large splats are rare, and mostly in front.
  constexpr int most_parts = 5, most_tiles = 8;
  const int parts_x = right / part_side_px - left / part_side_px + 1;
  const int parts_y = bottom / part_side_px - top / part_side_px + 1;
  if (parts_x <= most_parts && parts_y <= most_parts) {
    for (int y = top / part_side_px; y <= bottom / part_side_px; ++y) {
      for (int x = left / part_side_px; x <= right / part_side_px; ++x) {
        if (!(depth > part[part_position(shape, x, y)])) return false;
      }
    }
    return true;
  }
  if (parts_x > most_tiles * parts_across || parts_y > most_tiles * parts_across) return false;
  for (int y = top / tile_side_px; y <= bottom / tile_side_px; ++y)
    for (int x = left / tile_side_px; x <= right / tile_side_px; ++x)
      if (!(depth > tile[y * shape.tiles_x + x].y)) return false;
  return true;
}

}  // namespace catgs::cuda
