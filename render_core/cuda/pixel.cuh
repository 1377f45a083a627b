#pragma once

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/math/blend-inl.h"

namespace catgs::cuda {

/// Whether a pixel of the grid is in the picture. Tiles may lie partly or wholly outside.
__device__ inline bool in_picture(const FrameShape& shape, int x_px, int y_px) {
  const int x = x_px - shape.left_px, y = y_px - shape.top_px;
  return x >= 0 && y >= 0 && x < shape.width_px && y < shape.height_px;
}

/// When a pixel is finished.
struct Finish {
  float transmittance;  // below this one
  // A finished pixel's colour stands for what lies behind it. Otherwise the background does.
  bool fills;
};

/// Writes a blended pixel over its background. `rgb`: [height][width][3], display-referred, in [0,
/// 1]. Pixels outside the picture are dropped.
__device__ inline void show_pixel(float* rgb, const FrameShape& shape, int x_px, int y_px,
                                  math::PixelState<float> pixel, float3 background,
                                  const Finish& finish) {
  if (!in_picture(shape, x_px, y_px)) return;
  if (finish.fills) pixel = math::filled(pixel, finish.transmittance);
  const auto shown = math::resolve<float>(pixel, {background.x, background.y, background.z});
  const int x = x_px - shape.left_px, y = y_px - shape.top_px;
  float* out = rgb + 3 * (static_cast<std::size_t>(y) * shape.width_px + x);
  out[0] = shown.x;
  out[1] = shown.y;
  out[2] = shown.z;
}

}  // namespace catgs::cuda
