#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/reorder.cuh"
#include "render_core/cuda/sort.cuh"

namespace catgs::cuda {
namespace {

constexpr int warps = 4;
constexpr int block_size = warps * warp_size;

// A warp sorts a window of 256 entries, eight a lane, writes the nearer half and slides by it.
constexpr int per_lane = 8;
constexpr int window = per_lane * warp_size;
constexpr int step = window / 2;

// A key holds the depth and, below it, the place in the window, which makes the sort stable.
constexpr int place_bits = 8;
static_assert(window == 1 << place_bits);
static_assert(depth_bits + place_bits <= 32);
constexpr std::uint32_t behind_all = ~0u;

/// Ascending bitonic sort of the warp's keys; key j of lane l is number per_lane l + j.
__device__ void sort_window(std::uint32_t (&key)[per_lane]) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
#pragma unroll
  for (int size = 2; size <= window; size *= 2) {
#pragma unroll
    for (int stride = size / 2; stride > 0; stride /= 2) {
#pragma unroll
      for (int j = 0; j < per_lane; ++j) {
        const int number = per_lane * lane + j;
        const bool up = (number & size) == 0;
        if (stride >= per_lane) {
          const std::uint32_t other = __shfl_xor_sync(~0u, key[j], stride / per_lane);
          const bool low = (number & stride) == 0;
          key[j] = low == up ? min(key[j], other) : max(key[j], other);
        } else if ((j & stride) == 0) {
          const std::uint32_t a = key[j], b = key[j + stride];
          key[j] = up ? min(a, b) : max(a, b);
          key[j + stride] = up ? max(a, b) : min(a, b);
        }
      }
    }
  }
}

/// Slots first…last - 1 of the list, by one warp. `held` is the warp's scratch.
__device__ void reorder(const ReorderParams& p, std::uint32_t first, std::uint32_t last,
                        std::uint32_t (&held)[window]) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const auto load = [&](int place, std::uint32_t at) { held[place] = at < last ? p.slot[at] : 0; };
  for (int j = 0; j < per_lane; ++j)
    load(j * warp_size + lane, first + static_cast<std::uint32_t>(j * warp_size + lane));
  for (;; first += step) {
    __syncwarp();
    const int present = static_cast<int>(min(last - first, static_cast<std::uint32_t>(window)));
    std::uint32_t key[per_lane];
#pragma unroll
    for (int j = 0; j < per_lane; ++j) {
      const int place = per_lane * lane + j;
      key[j] = behind_all;
      if (place < present)
        key[j] = p.depth_key[held[place]] >> depth_bits_below << place_bits |
                 static_cast<std::uint32_t>(place);
    }
    sort_window(key);
    std::uint32_t slot[per_lane];
#pragma unroll
    for (int j = 0; j < per_lane; ++j) slot[j] = held[key[j] & ((1u << place_bits) - 1u)];
    __syncwarp();
#pragma unroll
    for (int j = 0; j < per_lane; ++j) held[per_lane * lane + j] = slot[j];
    __syncwarp();
    const bool ends = present <= step || first + window >= last;
    for (int place = lane; place < (ends ? present : step); place += warp_size)
      p.slot[first + static_cast<std::uint32_t>(place)] = held[place];
    if (ends) return;
    __syncwarp();
    std::uint32_t kept[step / warp_size];
#pragma unroll
    for (int j = 0; j < step / warp_size; ++j) kept[j] = held[step + j * warp_size + lane];
    __syncwarp();
#pragma unroll
    for (int j = 0; j < step / warp_size; ++j) {
      held[j * warp_size + lane] = kept[j];
      load(step + j * warp_size + lane,
           first + static_cast<std::uint32_t>(window + j * warp_size + lane));
    }
  }
}

// The comb: a block takes so many entries of a tile at a time, in as many interleaved windows.
// Their number is odd, so that a warp's entries lie in different banks of shared memory.
constexpr int comb_warps = 15;
constexpr int comb_block = comb_warps * warp_size;
constexpr int combed_at_once = comb_warps * window;
constexpr unsigned comb_blocks_per_tile = 4;

/// Sorts entries first, first + stride, … of `slots`, a window of them, by one warp.
__device__ void comb(const ReorderParams& p, std::uint32_t* slots, int first, int stride,
                     int count) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const int present = (count - first + stride - 1) / stride;
  std::uint32_t key[per_lane], slot[per_lane];
#pragma unroll
  for (int j = 0; j < per_lane; ++j) {
    const int place = j * warp_size + lane;
    key[j] = behind_all;
    if (place < present)
      key[j] = p.depth_key[slots[first + place * stride]] >> depth_bits_below << place_bits |
               static_cast<std::uint32_t>(place);
  }
  sort_window(key);
#pragma unroll
  for (int j = 0; j < per_lane; ++j) {
    if (per_lane * lane + j >= present) continue;
    slot[j] = slots[first + static_cast<int>(key[j] & ((1u << place_bits) - 1u)) * stride];
  }
  __syncwarp();
#pragma unroll
  for (int j = 0; j < per_lane; ++j)
    if (per_lane * lane + j < present) slots[first + (per_lane * lane + j) * stride] = slot[j];
}

__global__ void __launch_bounds__(comb_block) comb_kernel(const ReorderParams p) {
  __shared__ std::uint32_t slots[combed_at_once];
  const int thread = static_cast<int>(threadIdx.x), warp = thread / warp_size;
  const std::uint32_t combed = p.combed[blockIdx.x];
  for (std::uint32_t begin = blockIdx.y * combed_at_once; begin + window < combed;
       begin += comb_blocks_per_tile * combed_at_once) {
    std::uint32_t* list = &p.slot[p.range[blockIdx.x].x + begin];
    const int count = static_cast<int>(min(combed - begin, std::uint32_t{combed_at_once}));
    for (int i = thread; i < count; i += comb_block) slots[i] = list[i];
    __syncthreads();
    const int stride = (count + window - 1) / window | 1;
    if (warp < stride) comb(p, slots, warp, stride, count);
    __syncthreads();
    for (int i = thread; i < count; i += comb_block) list[i] = slots[i];
    __syncthreads();
  }
}

__global__ void __launch_bounds__(block_size) reorder_kernel(const ReorderParams p) {
  __shared__ std::uint32_t held[warps][window];
  const std::uint32_t warp = threadIdx.x / warp_size;
  const std::uint32_t runs = p.counts->runs;
  for (std::uint32_t r = blockIdx.x * warps + warp; r < runs; r += gridDim.x * warps) {
    const uint2 run = p.runs[r];
    reorder(p, run.x, run.y, held[warp]);
    __syncwarp();
  }
}

}  // namespace

void launch_reorder(const ReorderParams& params, cudaStream_t stream) {
  comb_kernel<<<dim3(params.shape.tiles(), comb_blocks_per_tile), comb_block, 0, stream>>>(params);
  check_launch("comb");
  constexpr int blocks_per_processor = 16;
  reorder_kernel<<<params.processors * blocks_per_processor, block_size, 0, stream>>>(params);
  check_launch("reorder");
}

}  // namespace catgs::cuda
