#pragma once

#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/pixel.cuh"

namespace catgs::cuda {

// A warp blends a part (8x8 px) of a tile in two halves (8x4 px). Each half has its own list of
// splats, because most splats that reach a part miss half of it. To load and store pixels, each
// half-warp has a half, and each lane two of its pixels.
constexpr int half_lanes = warp_size / halves;
constexpr int pixels_per_lane = part_side_px * block_height_px / half_lanes;
constexpr int half_pixels = half_lanes * pixels_per_lane;
constexpr int rows_per_pass = block_height_px / pixels_per_lane;

/// A pixel as blending sees it.
struct PartPixel {
  float x, y;   // its centre, px from the origin of the part
  bool inside;  // of the picture
};

/// The pixels of a lane in a part of a tile: one column, rows_per_pass apart.
class PartPixels {
 public:
  __device__ PartPixels(const FrameShape& shape, std::uint32_t tile, int part) {
    const int lane = static_cast<int>(threadIdx.x) % warp_size;
    column_ = lane % part_side_px;
    row_ = lane / half_lanes * block_height_px + lane % half_lanes / part_side_px;
    in_tile_ = part * part_pixels + row_ * part_side_px + column_;
    const int2 corner = part_corner_px(shape, tile, part);
    x_px_ = corner.x + column_;
    y_px_ = corner.y + row_;
  }

  /// Origin of the part: the pixel corner in its middle, px in the grid.
  __device__ float origin_x() const { return static_cast<float>(x_px_ - column_ + middle); }
  __device__ float origin_y() const { return static_cast<float>(y_px_ - row_ + middle); }
  /// Whether any of the part is in the picture.
  __device__ bool shows(const FrameShape& shape) const {
    const int x = x_px_ - column_ - shape.left_px, y = y_px_ - row_ - shape.top_px;
    return x > -part_side_px && y > -part_side_px && x < shape.width_px && y < shape.height_px;
  }
  /// Number k of the half_lanes pixels that are the i-th of their lanes in half `half`.
  __device__ PartPixel part_pixel(const FrameShape& shape, int half, int i, int k) const {
    const int x = k % part_side_px - middle;
    const int y = half * block_height_px + i * rows_per_pass + k / part_side_px - middle;
    return {static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f,
            in_picture(shape, x_px_ - column_ + middle + x, y_px_ - row_ + middle + y)};
  }
  __device__ int2 position(int i) const { return make_int2(x_px_, y_px_ + i * rows_per_pass); }
  __device__ int in_tile(int i) const { return in_tile_ + i * rows_per_pass * part_side_px; }

 private:
  static constexpr int middle = part_side_px / 2;

  int column_, row_;  // in the part
  int in_tile_;
  int x_px_, y_px_;
};

}  // namespace catgs::cuda
