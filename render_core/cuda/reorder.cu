#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/reorder.cuh"
#include "render_core/cuda/sort.cuh"

namespace catgs::cuda {
namespace {

constexpr int warps = 4;
constexpr int block_size = warps * warp_size;

// A warp sorts a window of 256 entries, eight a lane, writes the first three quarters and slides by
// them.
constexpr int per_lane = 8;
constexpr int window = per_lane * warp_size;
constexpr int step = window / 4 * 3, carried = window - step;

// A key holds the depth and, below it, the place in the window.
constexpr int place_bits = 8;
static_assert(window == 1 << place_bits);
static_assert(depth_bits + place_bits <= 32);
constexpr std::uint32_t behind_all = ~0u;

using Keys = std::uint32_t[per_lane];

/// Ascending bitonic sort of the warp's keys; key j of lane l is number per_lane l + j.
__device__ void sort_window(Keys& key) {
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

/// A run of the list as a pass over it sees it: from its front, or from its back with depths that
/// count the other way.
template <bool forwards>
struct Pass {
  const std::uint32_t* depth_key;
  std::uint32_t* run;
  int count;

  __device__ std::uint32_t& slot(int i) const { return run[forwards ? i : count - 1 - i]; }
  __device__ std::uint32_t depth(std::uint32_t slot) const {
    constexpr std::uint32_t most = (1u << depth_bits) - 1u;
    const std::uint32_t depth = depth_key[slot] >> depth_bits_below;
    return forwards ? depth : most - depth;
  }
  /// Whether slots of the same depth stand in the wrong order.
  __device__ static bool swapped(std::uint32_t a, std::uint32_t b) {
    return forwards ? b < a : a < b;
  }
};

/// Sorted by depth, neighbours of the same depth are brought into the order of their slots, that of
/// key frames: how they stood before says nothing. Two rounds of odd-even transposition do that
/// for two of the same depth, and nearly for three; more are rare.
template <bool forwards>
__device__ void order_ties(const Keys& key, Keys& slot) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const auto depth = [](std::uint32_t k) { return k >> place_bits; };
  const auto order = [&](std::uint32_t depth_a, std::uint32_t depth_b, std::uint32_t& a,
                         std::uint32_t& b) {
    if (depth_a != depth_b || !Pass<forwards>::swapped(a, b)) return;
    const std::uint32_t first = b;
    b = a;
    a = first;
  };
  const std::uint32_t depth_after = depth(__shfl_down_sync(~0u, key[0], 1));
  const std::uint32_t depth_before = depth(__shfl_up_sync(~0u, key[per_lane - 1], 1));
#pragma unroll
  for (int j = 0; j < per_lane; j += 2)
    order(depth(key[j]), depth(key[j + 1]), slot[j], slot[j + 1]);
  std::uint32_t after = __shfl_down_sync(~0u, slot[0], 1);
  std::uint32_t before = __shfl_up_sync(~0u, slot[per_lane - 1], 1);
#pragma unroll
  for (int j = 1; j + 1 < per_lane; j += 2)
    order(depth(key[j]), depth(key[j + 1]), slot[j], slot[j + 1]);
  if (lane + 1 < warp_size) order(depth(key[per_lane - 1]), depth_after, slot[per_lane - 1], after);
  if (lane > 0) order(depth_before, depth(key[0]), before, slot[0]);
}

/// One pass over a run, by one warp. What belongs towards the end is carried there, however far;
/// what belongs towards the beginning comes as far as windows overlap. Returns whether that was too
/// little for some entry. `held` is the warp's scratch.
template <bool forwards>
__device__ bool slide(const Pass<forwards>& pass, std::uint32_t (&held)[window]) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  // Past the first-level cache: another warp may have written the neighbouring entries.
  const auto load = [&](int place, int at) {
    held[place] = at < pass.count ? __ldcg(&pass.slot(at)) : 0;
  };
  for (int j = 0; j < per_lane; ++j) load(j * warp_size + lane, j * warp_size + lane);
  bool too_far = false;
  std::uint32_t last_depth = 0;
  for (int first = 0;; first += step) {
    __syncwarp();
    const int present = min(pass.count - first, window);
    Keys key, slot;
#pragma unroll
    for (int j = 0; j < per_lane; ++j) {
      const int place = per_lane * lane + j;
      key[j] = behind_all;
      if (place < present)
        key[j] = pass.depth(held[place]) << place_bits | static_cast<std::uint32_t>(place);
    }
    sort_window(key);
    too_far |= __shfl_sync(~0u, key[0], 0) >> place_bits < last_depth;
    last_depth = __shfl_sync(~0u, key[per_lane - 1], step / per_lane - 1) >> place_bits;
#pragma unroll
    for (int j = 0; j < per_lane; ++j) slot[j] = held[key[j] & (window - 1)];
    order_ties<forwards>(key, slot);
    __syncwarp();
#pragma unroll
    for (int j = 0; j < per_lane; ++j) held[per_lane * lane + j] = slot[j];
    __syncwarp();
    const bool ends = first + window >= pass.count;
    for (int place = lane; place < (ends ? present : step); place += warp_size)
      pass.slot(first + place) = held[place];
    if (ends) return too_far;
    __syncwarp();
    std::uint32_t kept[carried / warp_size];
#pragma unroll
    for (int j = 0; j < carried / warp_size; ++j) kept[j] = held[step + j * warp_size + lane];
    __syncwarp();
#pragma unroll
    for (int j = 0; j < carried / warp_size; ++j) held[j * warp_size + lane] = kept[j];
#pragma unroll
    for (int j = 0; j < step / warp_size; ++j)
      load(carried + j * warp_size + lane, first + window + j * warp_size + lane);
  }
}

/// Entries first…last - 1 of the lists, in a pass or two.
__device__ void reorder(const ReorderParams& p, std::uint32_t first, std::uint32_t last,
                        std::uint32_t (&held)[window]) {
  std::uint32_t* run = p.slot + first;
  const int count = static_cast<int>(last - first);
  const bool too_far = slide<true>({p.depth_key, run, count}, held);
  __syncwarp();
  if (too_far) slide<false>({p.depth_key, run, count}, held);
  __syncwarp();
}

// Entries on either side of where two runs meet that are stitched.
constexpr std::uint32_t stitched = window;
static_assert(2 * stitched <= reorder_run);

/// To be called when one of the two runs that meet at `run` is in order; the later of the two calls
/// puts their neighbouring ends in order.
__device__ void meet(const ReorderParams& p, ReorderRun& run, std::uint32_t (&held)[window]) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  std::uint32_t met = 0;
  __threadfence();  // what this warp wrote, before the other one may see that it did
  __syncwarp();
  if (lane == 0) met = atomicAdd(&run.met, 1u);
  if (__shfl_sync(~0u, met, 0) == 0) return;
  __threadfence();
  __syncwarp();
  const auto depth = [&](std::uint32_t at) {
    return p.depth_key[__ldcg(&p.slot[at])] >> depth_bits_below;
  };
  if (depth(run.first - 1) <= depth(run.first)) return;
  reorder(p, run.first - stitched, min(run.first + stitched, run.last), held);
}

__global__ void __launch_bounds__(block_size) reorder_kernel(const ReorderParams p) {
  __shared__ std::uint32_t held[warps][window];
  const std::uint32_t warp = threadIdx.x / warp_size, runs = p.counts->runs;
  for (std::uint32_t r = blockIdx.x * warps + warp; r < runs; r += gridDim.x * warps) {
    ReorderRun& run = p.runs[r];
    reorder(p, run.first, run.last, held[warp]);
    if (run.continues != 0) meet(p, run, held[warp]);
    if (run.follows != 0) meet(p, p.runs[r + 1], held[warp]);
  }
}

}  // namespace

void launch_reorder(const ReorderParams& params, cudaStream_t stream) {
  constexpr int blocks_per_processor = 16;
  reorder_kernel<<<params.processors * blocks_per_processor, block_size, 0, stream>>>(params);
  check_launch("reorder");
}

}  // namespace catgs::cuda
