#include <bit>

#include "render_core/cuda/early_launch.cuh"
#include "render_core/cuda/reorder.cuh"
#include "render_core/cuda/sort.cuh"

namespace catgs::cuda {
namespace {

constexpr int warps = 4;
constexpr int block_size = warps * warp_size;

// A key holds a depth and, in its low bits, the entry's place among those that the warp sorts. Key
// j of lane l is number per_lane l + j.
template <int per_lane>
using Keys = std::uint32_t[per_lane];
template <int per_lane>
constexpr int entries_of = warp_size* per_lane;
template <int per_lane>
constexpr int place_bits = std::bit_width(static_cast<unsigned>(entries_of<per_lane>)) - 1;
constexpr std::uint32_t behind_all = ~0u;

// Keys per lane for a whole run.
constexpr int run_keys = reorder_run / warp_size;

__device__ int lane_index() { return static_cast<int>(threadIdx.x) % warp_size; }

/// The slots that a warp sorts, by place. Padded, because lanes read places a power of two apart.
class Held {
 public:
  __device__ std::uint32_t& operator[](int place) { return slot_[place + place / warp_size]; }

 private:
  std::uint32_t slot_[reorder_run + reorder_run / warp_size];
};

/// Orders a lane's key with another lane's. `low`: this lane takes the smaller one.
__device__ std::uint32_t ordered(std::uint32_t key, std::uint32_t other, bool low) {
  return low ? min(key, other) : max(key, other);
}

/// The stages of a bitonic merge within each lane: those that order keys up to `stride` apart.
template <int per_lane, int stride>
__device__ void merge_in_lane(Keys<per_lane>& key) {
#pragma unroll
  for (int j = 0; j < per_lane; ++j) {
    if ((j & stride) != 0) continue;
    const std::uint32_t a = key[j], b = key[j + stride];
    key[j] = min(a, b);
    key[j + stride] = max(a, b);
  }
  if constexpr (stride > 1) merge_in_lane<per_lane, stride / 2>(key);
}

/// Sorts each lane's keys, in ascending groups of `size` at first.
template <int per_lane, int size = 2>
__device__ void sort_in_lane(Keys<per_lane>& key) {
#pragma unroll
  for (int j = 0; j < per_lane; ++j) {
    const int mirrored = j ^ (size - 1);
    if (mirrored < j) continue;
    const std::uint32_t a = key[j], b = key[mirrored];
    key[j] = min(a, b);
    key[mirrored] = max(a, b);
  }
  if constexpr (size > 2) merge_in_lane<per_lane, size / 4>(key);
  if constexpr (size < per_lane) sort_in_lane<per_lane, 2 * size>(key);
}

/// Merges the sorted halves of each group of `lanes` lanes: a bitonic merge whose first stage reads
/// the second half backwards. It loops, because the whole network would not fit in the instruction
/// cache.
template <int per_lane>
__device__ void merge(Keys<per_lane>& key, int lanes) {
  const int lane = lane_index();
  bool low = (lane & lanes / 2) == 0;
#pragma unroll
  for (int j = 0; j < per_lane / 2; ++j) {
    const int mirrored = per_lane - 1 - j;
    const std::uint32_t a = __shfl_xor_sync(~0u, key[mirrored], lanes - 1);
    const std::uint32_t b = __shfl_xor_sync(~0u, key[j], lanes - 1);
    key[j] = ordered(key[j], a, low);
    key[mirrored] = ordered(key[mirrored], b, low);
  }
#pragma unroll 1
  for (int apart = lanes / 4; apart > 0; apart /= 2) {
    low = (lane & apart) == 0;
#pragma unroll
    for (int j = 0; j < per_lane; ++j)
      key[j] = ordered(key[j], __shfl_xor_sync(~0u, key[j], apart), low);
  }
  merge_in_lane<per_lane, per_lane / 2>(key);
}

template <int per_lane>
__device__ void sort(Keys<per_lane>& key) {
  sort_in_lane<per_lane>(key);
#pragma unroll 1
  for (int lanes = 2; lanes <= warp_size; lanes *= 2) merge<per_lane>(key, lanes);
}

/// Orders neighbours of equal depth by their slots, as in key frames; their previous order says
/// nothing. Two rounds of odd-even transposition do that for two of the same depth, and nearly for
/// three. More are rare.
template <int per_lane>
__device__ void order_ties(const Keys<per_lane>& key, Keys<per_lane>& slot) {
  const int lane = lane_index();
  const auto depth = [](std::uint32_t k) { return k >> place_bits<per_lane>; };
  const auto order = [](std::uint32_t depth_a, std::uint32_t depth_b, std::uint32_t& a,
                        std::uint32_t& b) {
    if (depth_a != depth_b || a < b) return;
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

/// Turns depths into keys; a key of behind_all stays. Depths count from the nearest one, and lose
/// their lowest bits if they have too many. place(j): place of key j.
template <int per_lane, class Place>
__device__ void pack(Keys<per_lane>& key, const Place& place) {
  std::uint32_t nearest = behind_all, farthest = 0;
#pragma unroll
  for (int j = 0; j < per_lane; ++j) {
    nearest = min(nearest, key[j]);
    if (key[j] != behind_all) farthest = max(farthest, key[j]);
  }
  nearest = __reduce_min_sync(~0u, nearest);
  farthest = __reduce_max_sync(~0u, farthest);
  constexpr int bits = 32 - place_bits<per_lane>;
  const int excess = max(0, 32 - __clz(static_cast<int>(farthest - nearest)) - bits);
#pragma unroll
  for (int j = 0; j < per_lane; ++j) {
    if (key[j] == behind_all) continue;
    key[j] =
        (key[j] - nearest) >> excess << place_bits<per_lane> | static_cast<std::uint32_t>(place(j));
  }
}

/// Writes the slots in `held` back to `list` in the order of their keys.
template <int per_lane>
__device__ void write(const Keys<per_lane>& key, Held& held, std::uint32_t* list, int count) {
  const int lane = lane_index();
  Keys<per_lane> slot;
#pragma unroll
  for (int j = 0; j < per_lane; ++j)  // padding ties with no entry
    slot[j] = per_lane * lane + j < count
                  ? held[static_cast<int>(key[j] & (entries_of<per_lane> - 1))]
                  : behind_all;
  order_ties<per_lane>(key, slot);
  __syncwarp();
#pragma unroll
  for (int j = 0; j < per_lane; ++j) held[per_lane * lane + j] = slot[j];
  __syncwarp();
  for (int place = lane; place < count; place += warp_size) list[place] = held[place];
  __syncwarp();
}

__device__ std::uint32_t depth_of(const ReorderParams& p, std::uint32_t slot) {
  return p.depth_key[slot] >> depth_bits_below;
}

/// Sorts `count` entries.
template <int per_lane>
__device__ void sort_run(const ReorderParams& p, std::uint32_t* list, int count, Held& held) {
  const int lane = lane_index();
  Keys<per_lane> key;
  const auto place = [lane](int j) { return j * warp_size + lane; };
#pragma unroll
  for (int j = 0; j < per_lane; ++j) key[j] = list[min(place(j), count - 1)];
#pragma unroll
  for (int j = 0; j < per_lane; ++j) {
    held[place(j)] = key[j];
    key[j] = place(j) < count ? depth_of(p, key[j]) : behind_all;
  }
  pack<per_lane>(key, place);
  sort<per_lane>(key);
  __syncwarp();
  write<per_lane>(key, held, list, count);
}

/// Merges the sorted half run before `middle` with as many entries behind it, or with `behind`
/// entries if they are fewer.
__device__ void stitch(const ReorderParams& p, std::uint32_t* middle, int behind, Held& held) {
  constexpr int per_lane = run_keys, half = reorder_run / 2;
  const int lane = lane_index();
  const int count = half + min(behind, half);
  std::uint32_t* list = middle - half;
  // Bypasses the first-level cache, because another warp may have written them.
  for (int place = lane; place < count; place += warp_size) held[place] = __ldcg(&list[place]);
  __syncwarp();
  const auto place = [lane](int j) { return per_lane * lane + j; };
  Keys<per_lane> key;
#pragma unroll
  for (int j = 0; j < per_lane; ++j)
    key[j] = place(j) < count ? depth_of(p, held[place(j)]) : behind_all;
  pack<per_lane>(key, place);
  merge<per_lane>(key, warp_size);
  write<per_lane>(key, held, list, count);
}

/// Call when one of the two runs that meet at `run` is sorted. The later of the two calls merges
/// their neighbouring ends.
__device__ void meet(const ReorderParams& p, ReorderRun& run, Held& held) {
  std::uint32_t met = 0;
  __threadfence();  // publishes what this warp wrote before the other warp can see the count
  __syncwarp();
  if (lane_index() == 0) met = atomicAdd(&run.met, 1u);
  if (__shfl_sync(~0u, met, 0) == 0) return;
  __threadfence();
  __syncwarp();
  const auto depth = [&](std::uint32_t at) { return depth_of(p, __ldcg(&p.slot[at])); };
  if (depth(run.first - 1) <= depth(run.first)) return;
  stitch(p, p.slot + run.first, static_cast<int>(run.last - run.first), held);
}

// Up to this number, more warps at a time are faster than avoiding spilled registers.
constexpr int blocks_at_a_time = 8;

__global__ void __launch_bounds__(block_size, blocks_at_a_time)
    reorder_kernel(const ReorderParams p) {
  __shared__ Held of_warp[warps];
  Held& held = of_warp[threadIdx.x / warp_size];
  wait_for_earlier_work();
  const std::uint32_t warp = threadIdx.x / warp_size, runs = p.counts->runs;
  for (std::uint32_t r = blockIdx.x * warps + warp; r < runs; r += gridDim.x * warps) {
    ReorderRun& run = p.runs[r];
    std::uint32_t* list = p.slot + run.first;
    const int count = static_cast<int>(run.last - run.first);
    if (count <= entries_of<4>)
      sort_run<4>(p, list, count, held);
    else if (count <= entries_of<8>)
      sort_run<8>(p, list, count, held);
    else
      sort_run<run_keys>(p, list, count, held);
    if (run.continues != 0) meet(p, run, held);
    if (run.follows != 0) meet(p, p.runs[r + 1], held);
  }
}

}  // namespace

void launch_reorder(const ReorderParams& params, cudaStream_t stream) {
  // Runs differ in work, so there are more blocks than fit at a time; in most, each warp takes one
  // run.
  constexpr int blocks_per_processor = 6 * blocks_at_a_time;
  launch_early("reorder", reorder_kernel, params.processors * blocks_per_processor, block_size,
               stream, params);
}

}  // namespace catgs::cuda
