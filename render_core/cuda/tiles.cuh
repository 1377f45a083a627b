#pragma once

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/math/constants.h"
#include "render_core/math/ellipse-inl.h"

namespace catgs::cuda {

/// The tiles a splat reaches: rows first_row…last_row, and in each row columns by `columns`.
struct TileFootprint {
  math::Ellipse<float> ellipse;
  float2 centre_px;
  int first_row, last_row;
  FrameShape shape;

  /// First and last column of one tile row; empty when first > last. A tile counts when the
  /// rectangle of its pixel centres, as far as they lie in the image, meets the ellipse.
  __device__ int2 columns(int row) const {
    constexpr float tile = math_tile;
    const float top = static_cast<float>(row) * tile + 0.5f;
    const float bottom = fminf(top + (tile - 1.0f), static_cast<float>(shape.height_px) - 0.5f);
    const auto cut = math::columns_in_band(ellipse, top - centre_px.y, bottom - centre_px.y);
    const float low = cut.low + centre_px.x;
    const float high = cut.high + centre_px.x;
    if (cut.low > cut.high || high < 0.5f || low > static_cast<float>(shape.width_px) - 0.5f) {
      return make_int2(0, -1);
    }
    const float first = ceilf((low - (tile - 0.5f)) * (1.0f / tile));
    const float last = floorf((high - 0.5f) * (1.0f / tile));
    return make_int2(static_cast<int>(fmaxf(first, 0.0f)),
                     static_cast<int>(fminf(last, static_cast<float>(shape.tiles_x - 1))));
  }

  static constexpr float math_tile = static_cast<float>(tile_size_px);
};

/// Footprint of a splat with `half_extent` (px) around its centre; no rows when it reaches none.
__device__ inline TileFootprint make_footprint(float2 centre_px, const math::Whitening<float>& w,
                                               float log2_opacity, const FrameShape& shape) {
  constexpr float tile = TileFootprint::math_tile;
  const float reach = math::reach_of(log2_opacity);
  // Half extents of {|W d|^2 <= reach}: dy = root / yy, dx = root |W^-1 row| .
  const float root = sqrtf(fmaxf(reach, 0.0f));
  const float half_y = root / w.yy;
  const float half_x = root * sqrtf(w.xy * w.xy + w.yy * w.yy) / (w.xx * w.yy);
  TileFootprint f;
  f.ellipse = math::make_ellipse(w, reach, half_x, math::rightmost_y(w, fmaxf(reach, 0.0f)));
  f.centre_px = centre_px;
  f.shape = shape;
  const float top = (centre_px.y - half_y - (tile - 0.5f)) * (1.0f / tile);
  const float bottom = (centre_px.y + half_y - 0.5f) * (1.0f / tile);
  f.first_row = max(0, static_cast<int>(ceilf(fmaxf(top, -1.0f))));
  f.last_row = min(shape.tiles_y - 1,
                   static_cast<int>(floorf(fminf(bottom, static_cast<float>(shape.tiles_y)))));
  if (reach < 0.0f) f.last_row = -1;
  return f;
}

}  // namespace catgs::cuda
