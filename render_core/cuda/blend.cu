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
constexpr int rows_per_pass = half_height_px / pixels_per_lane;
constexpr int parts_across = tile_size_px / part_size_px;

/// Splats staged for the two halves of a part, front to back. Coordinates are from the part's
/// corner: small numbers keep the exponent exact to 1e-4.
struct StagedSplats {
  float4 u_xx_xy_v[halves][warp_size];
  float4 yy_opacity_red_green[halves][warp_size];
  float blue[halves][warp_size];
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

/// Which halves of the part a splat centred at shape.x, shape.y reaches with alpha_min: the minimum
/// of a convex quadratic over the box of a half's pixel centres lies on the line through the box
/// point nearest in x, on that nearest in y, or at the centre.
__device__ void reaches_halves(const float4& shape, const float4& rest, bool (&hit)[halves]) {
  constexpr float first = 0.5f, width = part_size_px - 1.0f, height = half_height_px - 1.0f;
  const math::Whitening<float> w{shape.z, shape.w, rest.x};
  const float reach = math::reach_of(rest.y) + 1e-3f;
  const float low_x = first - shape.x, high_x = low_x + width;
  const float x = math::clamp(0.0f, low_x, high_x);
  const float best_y = __fdividef(-w.xx * w.xy * x, w.xy * w.xy + w.yy * w.yy);
  const float x_per_y = __fdividef(-w.xy, w.xx);
#pragma unroll
  for (int half = 0; half < halves; ++half) {
    const float low_y = first + static_cast<float>(half * half_height_px) - shape.y;
    const float high_y = low_y + height;
    const float y = math::clamp(0.0f, low_y, high_y);
    const float y_for_x = math::clamp(best_y, low_y, high_y);
    const float x_for_y = math::clamp(x_per_y * y, low_x, high_x);
    hit[half] = fminf(math::whitened_square<float>(w, {x, y_for_x}),
                      math::whitened_square<float>(w, {x_for_y, y})) <= reach;
  }
}

/// Stages the warp's splats, one a lane, for the halves that they reach; the shorter list is filled
/// up with nothing. Returns the length of the longer.
__device__ int stage(StagedSplats& staged, const Loaded& splat) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const auto field = math::exponent_field<float>({splat.shape.z, splat.shape.w, splat.rest.x},
                                                 {splat.shape.x, splat.shape.y}, splat.rest.y);
  const float2 red_green = __half22float2(reinterpret_cast<const __half2&>(splat.rest.z));
  const float blue = __low2float(reinterpret_cast<const __half2&>(splat.rest.w));
  bool hit[halves];
  reaches_halves(splat.shape, splat.rest, hit);
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
    product *= known[(slice - back) * parts_per_tile + part];
  }
#pragma unroll
  for (int step = warp_size / 2; step > 0; step /= 2)
    product *= __shfl_xor_sync(~0u, product, step);
  return product;
}

/// Where a lane's first pixel lies in its part; the others lie rows_per_pass below.
__device__ int column_in_part(int lane) { return lane % part_size_px; }
__device__ int row_in_part(int lane) {
  return lane / half_lanes * half_height_px + lane % half_lanes / part_size_px;
}

/// Part of a task: the pixels of this lane and where they are.
struct Part {
  BlendTask task;
  std::uint32_t slice;  // where the slice's pixels are kept, if it is one
  int part;
  int in_tile_x, in_tile_y;  // of the lane's first pixel
  int x_px, y_px;
};

__device__ Part make_part(const BlendParams& p, std::uint32_t task, int part_of_tile) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  Part part;
  part.slice = task - p.shape.tiles();
  part.part = part_of_tile;
  const uint4 words = __ldg(reinterpret_cast<const uint4*>(&p.tasks[task]));
  part.task = {words.x, words.y, words.z, static_cast<std::uint16_t>(words.w & 0xffffu),
               static_cast<std::uint16_t>(words.w >> 16)};
  part.in_tile_x = part.part % parts_across * part_size_px + column_in_part(lane);
  part.in_tile_y = part.part / parts_across * part_size_px + row_in_part(lane);
  const int tile = static_cast<int>(part.task.tile);
  part.x_px = tile % p.shape.tiles_x * tile_size_px + part.in_tile_x;
  part.y_px = tile / p.shape.tiles_x * tile_size_px + part.in_tile_y;
  return part;
}

using Pixels = math::PixelState<float>[pixels_per_lane];

__device__ void store(const BlendParams& p, const Part& part, const Pixels& pixels) {
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) {
    const int y = part.y_px + i * rows_per_pass;
    if (part.task.slices > 1) {
      const std::size_t at =
          slice_pixel(part.slice, part.in_tile_x, part.in_tile_y + i * rows_per_pass);
      const math::Vec3<float>& c = pixels[i].colour;
      p.slice_pixels[at] = make_float4(c.x, c.y, c.z, pixels[i].transmittance);
    } else {
      show_pixel(p.rgb, p.shape, part.x_px, y, pixels[i], p.background);
    }
  }
}

/// Blends the staged splats into the lane's pixels; returns how many pairs were blended when
/// counting.
template <bool count_pairs>
__device__ unsigned blend_staged(const StagedSplats& staged, int count, Pixels& pixels) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const int half = lane / half_lanes;
  const float x = static_cast<float>(column_in_part(lane)) + 0.5f;
  const float y = static_cast<float>(row_in_part(lane)) + 0.5f;
  unsigned pairs = 0;
#pragma unroll 2
  for (int j = 0; j < count; ++j) {
    const float4 a = staged.u_xx_xy_v[half][j];
    const float4 b = staged.yy_opacity_red_green[half][j];
    const math::ExponentField<float> field{a.x, a.y, a.z, a.w, b.x, b.y};
    const math::Vec3<float> colour{b.z, b.w, staged.blue[half][j]};
#pragma unroll
    for (int i = 0; i < pixels_per_lane; ++i) {
      const float exponent = math::exponent_at(field, x, y + static_cast<float>(i * rows_per_pass));
      const float before = pixels[i].transmittance;
      math::blend<float>(pixels[i], exponent, colour);
      if (count_pairs) pairs += pixels[i].transmittance > 0.0f && pixels[i].transmittance != before;
    }
  }
  return pairs;
}

template <bool count_pairs>
__device__ void blend_part(const BlendParams& p, StagedSplats& staged, const Part& part) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const float corner_x = static_cast<float>(part.x_px - column_in_part(lane));
  const float corner_y = static_cast<float>(part.y_px - row_in_part(lane));
  Pixels pixels;
  bool live = false;
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) {
    pixels[i] = math::empty_pixel<float>();
    const bool inside =
        part.x_px < p.shape.width_px && part.y_px + i * rows_per_pass < p.shape.height_px;
    if (!inside) pixels[i].transmittance = -0.0f;
    live |= inside;
  }
  live = __any_sync(~0u, live);

  const std::uint32_t last = part.task.last;
  std::uint32_t first = part.task.first;
  unsigned long long pairs = 0;
  const auto behind_finished = [&] {
    // Half of it, so that rounding cannot make the composite want what was not blended.
    return part.task.slice > 0 && transmittance_before(p, part.slice, part.task.slice, part.part) <
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
    splat.shape.x -= corner_x;
    splat.shape.y -= corner_y;
    const int count = stage(staged, splat);
    pairs += blend_staged<count_pairs>(staged, count, pixels);
    __syncwarp();
    first += warp_size;
    bool lane_live = false;
#pragma unroll
    for (int i = 0; i < pixels_per_lane; ++i) lane_live |= pixels[i].transmittance > 0.0f;
    live = __any_sync(~0u, lane_live);
    if (group % 4 == 3 && behind_finished()) break;
  }
  if (count_pairs) atomicAdd(&p.counts->blended_pairs, pairs);
  store(p, part, pixels);

  const std::uint32_t consumed = min(first, last);
  float largest = 0.0f;  // of pixels that are not finished: nothing behind shows in those that are
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) largest = fmaxf(largest, pixels[i].transmittance);
  largest = __uint_as_float(__reduce_max_sync(~0u, __float_as_uint(largest)));
  if (lane != 0) return;
  if (part.task.slices > 1) {
    const std::uint32_t at = part.slice * parts_per_tile + part.part;
    p.consumed[at] = consumed;
    volatile float* known = p.slice_transmittance;
    known[at] = largest;
  } else {
    atomicMax(&p.reach[part.task.tile], consumed - part.task.first);
  }
}

/// Warps take parts from a queue: no warp waits for the longest part of its tile or block.
template <bool count_pairs>
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
    std::uint32_t place = work / parts_per_tile;
    int queue_class = 0;
    for (; queue_class < queue_classes; ++queue_class) {
      const std::uint32_t queued = p.counts->queued[queue_class];
      if (place < queued) break;
      place -= queued;
    }
    if (queue_class == queue_classes) return;
    const std::uint32_t task = p.queue[queue_class * p.shape.tiles() + place];
    blend_part<count_pairs>(p, staged[warp],
                            make_part(p, task, static_cast<int>(work % parts_per_tile)));
    __syncwarp();
  }
}

}  // namespace

int blend_warps(int processors) {
  int blocks = 0;
  check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, blend_kernel<false>, block_size, 0),
        "occupancy");
  return processors * blocks * warps_per_block;
}

void launch_blend(const BlendParams& params, cudaStream_t stream) {
  const auto kernel = params.count_pairs ? blend_kernel<true> : blend_kernel<false>;
  kernel<<<params.warps / warps_per_block, block_size, 0, stream>>>(params);
  check_launch("blend");
}

}  // namespace catgs::cuda
