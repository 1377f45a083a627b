#pragma once

#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/pixel.cuh"

namespace catgs::cuda {

// A warp blends a part (8x8 px) of a tile in two halves (8x4 px). Each half has its own list of
// splats, because most splats that reach a part miss half of it. To load and store pixels, each
// half-warp has a half, and each lane two of its pixels.
constexpr int halves = 2;
constexpr int half_lanes = warp_size / halves;
constexpr int half_height_px = part_size_px / halves;
constexpr int pixels_per_lane = part_size_px * half_height_px / half_lanes;
constexpr int half_pixels = half_lanes * pixels_per_lane;
constexpr int rows_per_pass = half_height_px / pixels_per_lane;
constexpr int parts_across = tile_size_px / part_size_px;

/// Bounds of pixel centres, px from the origin of a part, which is a pixel corner in its middle.
struct Box {
  float low_x, low_y, high_x, high_y;
};

/// A pixel as blending sees it.
struct PartPixel {
  float x, y;   // its centre, px from the origin of the part
  bool inside;  // of the picture and of the part
};

/// The pixels of a lane in a square part of a tile: one column, rows_per_pass apart.
class SquarePixels {
 public:
  static constexpr int most_parts = parts_per_tile;

  __device__ SquarePixels(const BlendParams& p, Box (&)[halves], std::uint32_t tile, int part) {
    const int lane = static_cast<int>(threadIdx.x) % warp_size;
    column_ = lane % part_size_px;
    row_ = lane / half_lanes * half_height_px + lane % half_lanes / part_size_px;
    in_tile_ = (part / parts_across * part_size_px + row_) * tile_size_px +
               part % parts_across * part_size_px + column_;
    const int tiles_x = p.shape.tiles_x;
    x_px_ = p.shape.shown_x_px + static_cast<int>(tile) % tiles_x * tile_size_px +
            in_tile_ % tile_size_px;
    y_px_ = p.shape.shown_y_px + static_cast<int>(tile) / tiles_x * tile_size_px +
            in_tile_ / tile_size_px;
  }

  __device__ static bool empty() { return false; }
  /// Origin of the part, px in the picture.
  __device__ float origin_x() const { return static_cast<float>(x_px_ - column_ + middle); }
  __device__ float origin_y() const { return static_cast<float>(y_px_ - row_ + middle); }
  /// Number k of the half_lanes pixels that are the i-th of their lanes in half `half`. Called by
  /// the whole warp.
  __device__ PartPixel part_pixel(const FrameShape& shape, int half, int i, int k) const {
    const int x = k % part_size_px - middle;
    const int y = half * half_height_px + i * rows_per_pass + k / part_size_px - middle;
    return {static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f,
            in_picture(shape, x_px_ - column_ + middle + x, y_px_ - row_ + middle + y)};
  }
  __device__ static Box box(const Box (&)[halves], int half) {
    const float top = 0.5f + static_cast<float>(half * half_height_px - middle);
    return {0.5f - middle, top, middle - 0.5f, top + (half_height_px - 1.0f)};
  }
  __device__ int2 place(int i) const { return make_int2(x_px_, y_px_ + i * rows_per_pass); }
  __device__ int in_tile(int i) const { return in_tile_ + i * rows_per_pass * tile_size_px; }
  __device__ bool inside(const FrameShape& shape, int i) const {
    return in_picture(shape, x_px_, y_px_ + i * rows_per_pass);
  }

 private:
  static constexpr int middle = part_size_px / 2;

  int column_, row_;  // in the part
  int in_tile_;
  int x_px_, y_px_;
};

/// The pixels of a lane in a part of a tile's run. A half-warp has half of the part, a lane every
/// half_lanes-th pixel of that.
class RunPixels {
 public:
  static constexpr int most_parts = most_run_parts;

  /// Sets `box`, which belongs to the warp.
  __device__ RunPixels(const BlendParams& p, Box (&box)[halves], std::uint32_t tile, int part) {
    const int lane = static_cast<int>(threadIdx.x) % warp_size;
    const int count = static_cast<int>(p.pixel_count[tile]);
    empty_ = part * part_pixels >= count;
    if (empty_) return;
    const int half = lane / half_lanes;
    const int begin = part * part_pixels + half * half_pixels;
    const int last = min(begin + half_pixels, count);
    in_tile_ = begin + lane % half_lanes;
    const PixelPlace* run = p.pixels + static_cast<std::size_t>(tile) * run_bound_px(p.shape);
    int2 low = make_int2(0xffff, 0xffff), high = make_int2(0, 0);
#pragma unroll
    for (int i = 0; i < pixels_per_lane; ++i) {
      inside_[i] = in_tile(i) < last;
      place_[i] = run[min(in_tile(i), last - 1)];
      low = make_int2(min(low.x, int{place_[i].x}), min(low.y, int{place_[i].y}));
      high = make_int2(max(high.x, int{place_[i].x}), max(high.y, int{place_[i].y}));
    }
#pragma unroll
    for (int step = half_lanes / 2; step > 0; step /= 2) widen(low, high, step);
    int2 part_low = low, part_high = high;
    widen(part_low, part_high, half_lanes);
    origin_x_ = (part_low.x + part_high.x + 1) / 2;
    origin_y_ = (part_low.y + part_high.y + 1) / 2;
    if (lane % half_lanes == 0)
      box[half] = {static_cast<float>(low.x - origin_x_) + 0.5f,
                   static_cast<float>(low.y - origin_y_) + 0.5f,
                   static_cast<float>(high.x - origin_x_) + 0.5f,
                   static_cast<float>(high.y - origin_y_) + 0.5f};
    __syncwarp();
  }

  __device__ bool empty() const { return empty_; }
  __device__ float origin_x() const { return static_cast<float>(origin_x_); }
  __device__ float origin_y() const { return static_cast<float>(origin_y_); }
  __device__ PartPixel part_pixel(const FrameShape&, int half, int i, int k) const {
    const int from = half * half_lanes + k;
    const std::uint32_t mine = place_[i].x | std::uint32_t{place_[i].y} << 16;
    const std::uint32_t place = __shfl_sync(~0u, mine, from);
    return {static_cast<float>(static_cast<int>(place & 0xffffu) - origin_x_) + 0.5f,
            static_cast<float>(static_cast<int>(place >> 16) - origin_y_) + 0.5f,
            __shfl_sync(~0u, inside_[i], from) != 0};
  }
  __device__ static Box box(const Box (&box)[halves], int half) { return box[half]; }
  __device__ int2 place(int i) const { return make_int2(place_[i].x, place_[i].y); }
  __device__ int in_tile(int i) const { return in_tile_ + i * half_lanes; }
  __device__ bool inside(const FrameShape&, int i) const { return inside_[i]; }

 private:
  __device__ static void widen(int2& low, int2& high, int step) {
    low.x = min(low.x, __shfl_xor_sync(~0u, low.x, step));
    low.y = min(low.y, __shfl_xor_sync(~0u, low.y, step));
    high.x = max(high.x, __shfl_xor_sync(~0u, high.x, step));
    high.y = max(high.y, __shfl_xor_sync(~0u, high.y, step));
  }

  bool empty_;
  int in_tile_;
  int origin_x_, origin_y_;  // of the part, px in the picture
  PixelPlace place_[pixels_per_lane];
  bool inside_[pixels_per_lane];
};

}  // namespace catgs::cuda
