#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/pixel.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/math/constants.h"

namespace catgs::cuda {
namespace {

constexpr int warps_per_block = 4;
constexpr int block_size = warps_per_block * warp_size;

// A half-warp takes the upper, the other the lower half of a part (8x4 px), each with its own list
// of splats: most splats that reach a part miss half of it. Two pixels a lane share what does not
// depend on the pixel.
constexpr int halves = 2;
constexpr int half_lanes = warp_size / halves;
constexpr int half_height_px = part_size_px / halves;
constexpr int pixels_per_lane = part_size_px * half_height_px / half_lanes;
constexpr int half_pixels = half_lanes * pixels_per_lane;
constexpr int rows_per_pass = half_height_px / pixels_per_lane;
constexpr int parts_across = tile_size_px / part_size_px;

/// Pixel centres from the corner of a part.
struct Box {
  float low_x, low_y, high_x, high_y;
};

/// Splats staged for the two halves of a part, front to back. Coordinates are from the part's
/// corner: small numbers keep the exponent exact to 1e-4.
struct StagedSplats {
  float4 u_xx_xy_v[halves][warp_size];
  float4 yy_opacity_red_green[halves][warp_size];
  float blue[halves][warp_size];
  Box box[halves];  // of parts that are no squares
};

/// A SplatRecord in two registers of four words.
struct Loaded {
  float4 shape;  // centre x, y (px), whitening xx, xy
  float4 rest;   // whitening yy, log2 opacity, red and green as half2, blue as half
};

__device__ Loaded load(const SplatRecord* records, std::uint32_t slot) {
  const float4* words = reinterpret_cast<const float4*>(&records[slot]);
  return {__ldg(&words[0]), __ldg(&words[1])};
}

/// Whether a splat centred at shape.x, shape.y reaches the box with alpha_min: the minimum of a
/// convex quadratic over a box lies on the line through the box point nearest in x, on that nearest
/// in y, or at the centre.
struct BoxTest {
  math::Whitening<float> w;
  float2 centre;
  float reach, y_per_x, x_per_y;

  __device__ bool reaches(const Box& box) const {
    const float low_x = box.low_x - centre.x, high_x = box.high_x - centre.x;
    const float low_y = box.low_y - centre.y, high_y = box.high_y - centre.y;
    const float x = math::clamp(0.0f, low_x, high_x);
    const float y = math::clamp(0.0f, low_y, high_y);
    const float y_for_x = math::clamp(y_per_x * x, low_y, high_y);
    const float x_for_y = math::clamp(x_per_y * y, low_x, high_x);
    return fminf(math::whitened_square<float>(w, {x, y_for_x}),
                 math::whitened_square<float>(w, {x_for_y, y})) <= reach;
  }
};

__device__ BoxTest make_box_test(const float4& shape, const float4& rest) {
  const math::Whitening<float> w{shape.z, shape.w, rest.x};
  return {w, make_float2(shape.x, shape.y), math::reach_of(rest.y) + 1e-3f,
          __fdividef(-w.xx * w.xy, w.xy * w.xy + w.yy * w.yy), __fdividef(-w.xy, w.xx)};
}

/// Stages the warp's splats, one a lane, for the halves that they reach; the shorter list is filled
/// up with nothing. Returns the length of the longer.
template <class Pixels>
__device__ int stage(StagedSplats& staged, const Pixels& pixels, const Loaded& splat) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const auto field = math::exponent_field<float>({splat.shape.z, splat.shape.w, splat.rest.x},
                                                 {splat.shape.x, splat.shape.y}, splat.rest.y);
  const float2 red_green = __half22float2(reinterpret_cast<const __half2&>(splat.rest.z));
  const float blue = __low2float(reinterpret_cast<const __half2&>(splat.rest.w));
  const BoxTest test = make_box_test(splat.shape, splat.rest);
  bool hit[halves];
#pragma unroll
  for (int half = 0; half < halves; ++half) hit[half] = test.reaches(pixels.box(staged, half));
  int count[halves];
#pragma unroll
  for (int half = 0; half < halves; ++half) {
    const unsigned lanes = __ballot_sync(~0u, hit[half]);
    count[half] = __popc(lanes);
    if (hit[half]) {
      const int at = __popc(lanes & ((1u << lane) - 1u));
      staged.u_xx_xy_v[half][at] = make_float4(field.u, field.xx, field.xy, field.v);
      staged.yy_opacity_red_green[half][at] =
          make_float4(field.yy, field.log2_opacity, red_green.x, red_green.y);
      staged.blue[half][at] = blue;
    }
  }
  const int shorter = count[0] < count[1] ? 0 : 1;
  if (lane >= count[shorter] && lane < count[1 - shorter])
    staged.yy_opacity_red_green[shorter][lane] = make_float4(0.0f, never, 0.0f, 0.0f);
  __syncwarp();
  return count[1 - shorter];
}

/// The largest transmittance that earlier slices of the task's tile leave in this part, as far as
/// they are known to have finished.
__device__ float transmittance_before(const BlendParams& p, std::uint32_t slice, int place,
                                      int part) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  float product = 1.0f;
  for (int back = 1 + lane; back <= place; back += warp_size) {
    const volatile float* known = p.slice_transmittance;
    product *= known[slice_part(p.shape, slice - back, part)];
  }
#pragma unroll
  for (int step = warp_size / 2; step > 0; step /= 2)
    product *= __shfl_xor_sync(~0u, product, step);
  return product;
}

/// The pixels of a lane in a square part of a tile: one column, rows_per_pass apart.
class SquarePixels {
 public:
  static constexpr int most_parts = parts_per_tile;

  __device__ SquarePixels(const BlendParams& p, StagedSplats&, std::uint32_t tile, int part) {
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
  /// Of the part, px in the picture.
  __device__ float corner_x() const { return static_cast<float>(x_px_ - column_); }
  __device__ float corner_y() const { return static_cast<float>(y_px_ - row_); }
  /// Centres, from the corner.
  __device__ float x(int) const { return static_cast<float>(column_) + 0.5f; }
  __device__ float y(int i) const { return static_cast<float>(row_ + i * rows_per_pass) + 0.5f; }
  __device__ static Box box(const StagedSplats&, int half) {
    const float top = 0.5f + static_cast<float>(half * half_height_px);
    return {0.5f, top, part_size_px - 0.5f, top + (half_height_px - 1.0f)};
  }
  __device__ int2 place(int i) const { return make_int2(x_px_, y_px_ + i * rows_per_pass); }
  __device__ int in_tile(int i) const { return in_tile_ + i * rows_per_pass * tile_size_px; }
  __device__ bool inside(const FrameShape& shape, int i) const {
    return in_picture(shape, x_px_, y_px_ + i * rows_per_pass);
  }

 private:
  int column_, row_;  // in the part
  int in_tile_;
  int x_px_, y_px_;
};

/// The pixels of a lane in a part of a tile's run: half of the part a half-warp, and of that every
/// half_lanes-th a lane.
class RunPixels {
 public:
  static constexpr int most_parts = most_run_parts;

  __device__ RunPixels(const BlendParams& p, StagedSplats& staged, std::uint32_t tile, int part) {
    const int lane = static_cast<int>(threadIdx.x) % warp_size;
    const int count = static_cast<int>(p.pixel_count[tile]);
    empty_ = part * part_pixels >= count;
    if (empty_) return;
    const int half = lane / half_lanes;
    const int begin = part * part_pixels + half * half_pixels;
    const int last = min(begin + half_pixels, count);
    in_tile_ = begin + lane % half_lanes;
    const PixelPlace* run = p.pixels + static_cast<std::size_t>(tile) * run_bound_px(p.shape);
    int low_x = 0xffff, low_y = 0xffff, high_x = 0, high_y = 0;
#pragma unroll
    for (int i = 0; i < pixels_per_lane; ++i) {
      inside_[i] = in_tile(i) < last;
      place_[i] = run[min(in_tile(i), last - 1)];
      low_x = min(low_x, int{place_[i].x});
      low_y = min(low_y, int{place_[i].y});
      high_x = max(high_x, int{place_[i].x});
      high_y = max(high_y, int{place_[i].y});
    }
#pragma unroll
    for (int step = half_lanes / 2; step > 0; step /= 2) {
      low_x = min(low_x, __shfl_xor_sync(~0u, low_x, step));
      low_y = min(low_y, __shfl_xor_sync(~0u, low_y, step));
      high_x = max(high_x, __shfl_xor_sync(~0u, high_x, step));
      high_y = max(high_y, __shfl_xor_sync(~0u, high_y, step));
    }
    corner_x_ = min(low_x, __shfl_xor_sync(~0u, low_x, half_lanes));
    corner_y_ = min(low_y, __shfl_xor_sync(~0u, low_y, half_lanes));
    if (lane % half_lanes == 0)
      staged.box[half] = {static_cast<float>(low_x - corner_x_) + 0.5f,
                          static_cast<float>(low_y - corner_y_) + 0.5f,
                          static_cast<float>(high_x - corner_x_) + 0.5f,
                          static_cast<float>(high_y - corner_y_) + 0.5f};
    __syncwarp();
  }

  __device__ bool empty() const { return empty_; }
  __device__ float corner_x() const { return static_cast<float>(corner_x_); }
  __device__ float corner_y() const { return static_cast<float>(corner_y_); }
  __device__ float x(int i) const { return static_cast<float>(place_[i].x - corner_x_) + 0.5f; }
  __device__ float y(int i) const { return static_cast<float>(place_[i].y - corner_y_) + 0.5f; }
  __device__ static Box box(const StagedSplats& staged, int half) { return staged.box[half]; }
  __device__ int2 place(int i) const { return make_int2(place_[i].x, place_[i].y); }
  __device__ int in_tile(int i) const { return in_tile_ + i * half_lanes; }
  __device__ bool inside(const FrameShape&, int i) const { return inside_[i]; }

 private:
  bool empty_;
  int in_tile_;
  int corner_x_, corner_y_;  // of the part, px in the picture
  PixelPlace place_[pixels_per_lane];
  bool inside_[pixels_per_lane];
};

__device__ BlendTask load_task(const BlendParams& p, std::uint32_t task) {
  const uint4 words = __ldg(reinterpret_cast<const uint4*>(&p.tasks[task]));
  return {words.x, words.y, words.z, static_cast<std::uint16_t>(words.w & 0xffffu),
          static_cast<std::uint16_t>(words.w >> 16)};
}

using States = math::PixelState<float>[pixels_per_lane];

template <class Pixels>
__device__ void store(const BlendParams& p, const BlendTask& task, std::uint32_t slice,
                      const Pixels& pixels, const States& states) {
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) {
    if (Pixels::most_parts == most_run_parts && !pixels.inside(p.shape, i)) continue;
    if (task.slices > 1) {
      const math::Vec3<float>& c = states[i].colour;
      p.slice_pixels[slice_pixel(p.shape, slice, pixels.in_tile(i))] =
          make_float4(c.x, c.y, c.z, states[i].transmittance);
    } else {
      const int2 place = pixels.place(i);
      show_pixel(p.rgb, p.shape, place.x, place.y, states[i], p.background);
    }
  }
}

/// Blends the staged splats into the lane's pixels; returns how many pairs were blended when
/// counting.
template <bool count_pairs, class Pixels>
__device__ unsigned blend_staged(const StagedSplats& staged, int count, const Pixels& pixels,
                                 States& states) {
  const int half = static_cast<int>(threadIdx.x) % warp_size / half_lanes;
  unsigned pairs = 0;
#pragma unroll 2
  for (int j = 0; j < count; ++j) {
    const float4 a = staged.u_xx_xy_v[half][j];
    const float4 b = staged.yy_opacity_red_green[half][j];
    const math::ExponentField<float> field{a.x, a.y, a.z, a.w, b.x, b.y};
    const math::Vec3<float> colour{b.z, b.w, staged.blue[half][j]};
#pragma unroll
    for (int i = 0; i < pixels_per_lane; ++i) {
      const float exponent = math::exponent_at(field, pixels.x(i), pixels.y(i));
      const float before = states[i].transmittance;
      math::blend<float>(states[i], exponent, colour);
      if (count_pairs) pairs += states[i].transmittance > 0.0f && states[i].transmittance != before;
    }
  }
  return pairs;
}

template <bool count_pairs, class Pixels>
__device__ void blend_part(const BlendParams& p, StagedSplats& staged, std::uint32_t task_index,
                           int part) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const BlendTask task = load_task(p, task_index);
  const std::uint32_t slice = task_index - p.shape.tiles();  // where its pixels are, if it is one
  const Pixels pixels(p, staged, task.tile, part);
  if (pixels.empty()) return;
  States states;
  bool live = false;
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) {
    states[i] = math::empty_pixel<float>();
    const bool inside = pixels.inside(p.shape, i);
    if (!inside) states[i].transmittance = -0.0f;
    live |= inside;
  }
  live = __any_sync(~0u, live);

  const std::uint32_t last = task.last;
  std::uint32_t first = task.first;
  unsigned long long pairs = 0;
  const auto behind_finished = [&] {
    // Half of it, so that rounding cannot make the composite want what was not blended.
    return task.slice > 0 && transmittance_before(p, slice, task.slice, part) <
                                 0.5f * static_cast<float>(transmittance_min);
  };
  if (behind_finished()) return;  // nobody will ask for this part of the slice
  // Two loads are in flight while a group is blended: the next group's records, and the slots of
  // the one after it.
  const Loaded nothing{make_float4(0.0f, 0.0f, 1.0f, 0.0f), make_float4(1.0f, never, 0.0f, 0.0f)};
  Loaded next = nothing;
  if (first + lane < last) next = load(p.records, p.slot[first + lane]);
  std::uint32_t next_slot = first + warp_size + lane < last ? p.slot[first + warp_size + lane] : 0;
  for (int group = 0; live && first < last; ++group) {
    Loaded splat = next;
    next = nothing;
    if (first + warp_size + lane < last) next = load(p.records, next_slot);
    if (first + 2 * warp_size + lane < last) next_slot = p.slot[first + 2 * warp_size + lane];
    splat.shape.x -= pixels.corner_x();
    splat.shape.y -= pixels.corner_y();
    const int count = stage(staged, pixels, splat);
    pairs += blend_staged<count_pairs>(staged, count, pixels, states);
    __syncwarp();
    first += warp_size;
    bool lane_live = false;
#pragma unroll
    for (int i = 0; i < pixels_per_lane; ++i) lane_live |= states[i].transmittance > 0.0f;
    live = __any_sync(~0u, lane_live);
    if (group % 4 == 3 && behind_finished()) break;
  }
  if (count_pairs) atomicAdd(&p.counts->blended_pairs, pairs);
  store(p, task, slice, pixels, states);

  const std::uint32_t consumed = min(first, last);
  float largest = 0.0f;  // of pixels that are not finished: nothing behind shows in those that are
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) largest = fmaxf(largest, states[i].transmittance);
  largest = __uint_as_float(__reduce_max_sync(~0u, __float_as_uint(largest)));
  if (lane != 0) return;
  if (task.slices > 1) {
    const std::uint32_t at = slice_part(p.shape, slice, part);
    p.consumed[at] = consumed;
    volatile float* known = p.slice_transmittance;
    known[at] = largest;
  } else {
    atomicMax(&p.reach[task.tile], consumed - task.first);
  }
}

/// Warps take parts from a queue: no warp waits for the longest part of its tile or block.
template <bool count_pairs, class Pixels>
__global__ void __launch_bounds__(block_size) blend_kernel(const BlendParams p) {
  __shared__ StagedSplats staged[warps_per_block];
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const int warp = static_cast<int>(threadIdx.x) / warp_size;
  // Lists are filled up by opacity alone, so that the rest must be numbers.
#pragma unroll
  for (int half = 0; half < halves; ++half) {
    staged[warp].u_xx_xy_v[half][lane] = make_float4(0.0f, 0.0f, 0.0f, 0.0f);
    staged[warp].blue[half][lane] = 0.0f;
  }
  __syncwarp();
  for (;;) {
    std::uint32_t work = 0;
    if (lane == 0) work = atomicAdd(&p.counts->next_part, 1u);
    work = __shfl_sync(~0u, work, 0);
    std::uint32_t place = work / Pixels::most_parts;
    int queue_class = 0;
    for (; queue_class < queue_classes; ++queue_class) {
      const std::uint32_t queued = p.counts->queued[queue_class];
      if (place < queued) break;
      place -= queued;
    }
    if (queue_class == queue_classes) return;
    const std::uint32_t task = p.queue[queue_class * p.shape.tiles() + place];
    blend_part<count_pairs, Pixels>(p, staged[warp], task,
                                    static_cast<int>(work % Pixels::most_parts));
    __syncwarp();
  }
}

}  // namespace

int blend_warps(int processors) {
  int blocks = 0;
  check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, blend_kernel<false, SquarePixels>,
                                                      block_size, 0),
        "occupancy");
  return processors * blocks * warps_per_block;
}

void launch_blend(const BlendParams& params, cudaStream_t stream) {
  const bool runs = params.pixels != nullptr;
  const auto kernel =
      params.count_pairs
          ? (runs ? blend_kernel<true, RunPixels> : blend_kernel<true, SquarePixels>)
          : (runs ? blend_kernel<false, RunPixels> : blend_kernel<false, SquarePixels>);
  kernel<<<params.warps / warps_per_block, block_size, 0, stream>>>(params);
  check_launch("blend");
}

}  // namespace catgs::cuda
