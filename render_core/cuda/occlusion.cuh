#pragma once

#include "render_core/cuda/blend.cuh"
#include "render_core/math/occlusion-inl.h"

namespace catgs::cuda {

/// The depths behind which nothing shows, expected from the View's last frame. Splats behind them
/// are not drawn.
struct Occlusion {
  const float* part = nullptr;   // [tiles][parts_per_tile], view depth; null: nothing is hidden
  const float2* tile = nullptr;  // [tiles], the smallest and the largest of a tile

  /// Whether a splat with this box, px in the picture, is behind the limits of all parts it meets.
  __device__ bool hides(const FrameShape& shape, float2 low_px, float2 high_px, float depth) const;
};

/// Carries the ends of parts (see PartEnds) over to the next frame: math::occlusion_limit().
struct OcclusionParams {
  FrameShape shape;  // of both frames
  math::CameraModel<float> now, last;
  int radius;              // math::occlusion_radius(), not negative
  const float* last_ends;  // [tiles][parts_per_tile]
  float* part;             // likewise, Occlusion::part
  float2* tile;            // [tiles], Occlusion::tile
};
void launch_occlusion(const OcclusionParams& params, cudaStream_t stream);

__device__ inline bool Occlusion::hides(const FrameShape& shape, float2 low_px, float2 high_px,
                                        float depth) const {
  if (part == nullptr) return false;
  const int last_x = shape.width_px - 1, last_y = shape.height_px - 1;
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
