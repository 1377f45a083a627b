#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/list_repair.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 256;
constexpr unsigned warps = block_size / warp_size;
constexpr unsigned half_run = warp_size;
constexpr unsigned run = 2 * half_run;
constexpr unsigned segment = warps * run;  // entries that a block has in shared memory
// Long lists decide how long the stage takes, so several blocks share a tile.
constexpr unsigned blocks_per_tile = 4;

/// A list's entry and its depth. Behind the list's end: infinitely far.
struct Member {
  TileEntry entry;
  float depth;
};

__device__ Member load(const ListRepairParams& p, std::uint32_t at, std::uint32_t last) {
  if (at >= last) return {{0, 0}, INFINITY};
  const uint2 words = reinterpret_cast<const uint2*>(p.entries)[at];
  return {{words.x, words.y}, __ldg(&p.splat_depth[words.x])};
}

/// The entries of a tile's list that are repaired end before this one.
__device__ std::uint32_t repaired_end(const ListRepairParams& p, std::uint32_t tile) {
  const uint2 range = p.range[tile];
  if (p.reach == nullptr) return range.y;
  const std::uint32_t reach = p.reach[tile];
  // As far as the tile may look now.
  return reach < range.y - range.x ? min(range.y, range.x + reach + reach / 4 + 2 * run) : range.y;
}

/// Writes the run of a warp that begins at `first` to `sorted`, in order of depth: each entry goes
/// behind those that are nearer, or as near and before it. Returns whether the order changes.
__device__ bool sort_run(const ListRepairParams& p, std::uint32_t first, std::uint32_t last,
                         Member* sorted) {
  const unsigned lane = threadIdx.x % warp_size;
  const Member low = load(p, first + lane, last), high = load(p, first + half_run + lane, last);
  const float next_low = __shfl_down_sync(~0u, low.depth, 1);
  const float next_high = __shfl_down_sync(~0u, high.depth, 1);
  const float first_high = __shfl_sync(~0u, high.depth, 0);
  const bool falls = low.depth > (lane + 1 < warp_size ? next_low : first_high) ||
                     (lane + 1 < warp_size && high.depth > next_high);
  unsigned low_rank = lane, high_rank = half_run + lane;
  const bool changes = __any_sync(~0u, falls) != 0;
  if (changes) {
    low_rank = high_rank = 0;
#pragma unroll 8
    for (unsigned j = 0; j < warp_size; ++j) {
      const float a = __shfl_sync(~0u, low.depth, static_cast<int>(j));
      const float b = __shfl_sync(~0u, high.depth, static_cast<int>(j));
      low_rank += (a < low.depth || (a == low.depth && j < lane)) + (b < low.depth);
      high_rank += (a <= high.depth) + (b < high.depth || (b == high.depth && j < lane));
    }
  }
  sorted[low_rank] = low;
  sorted[high_rank] = high;
  return changes;
}

/// How many of the warp's ascending `depths` are less than `depth`, or also equal to it.
template <bool equal_ones>
__device__ unsigned count_before(float depths, float depth) {
  unsigned count = 0;
#pragma unroll
  for (unsigned step = warp_size / 2; step > 0; step /= 2) {
    const float at = __shfl_sync(~0u, depths, static_cast<int>(count + step - 1));
    if (equal_ones ? at <= depth : at < depth) count += step;
  }
  const float at = __shfl_sync(~0u, depths, static_cast<int>(count));
  return count + (equal_ones ? at <= depth : at < depth);
}

/// Merges the second half of a run and the first half of the next one, both in order of depth, into
/// the list from `first` on. `write`: also where the merged order is that of the two.
__device__ void merge_halves(const ListRepairParams& p, std::uint32_t first, std::uint32_t last,
                             const Member& near, const Member& far, bool write) {
  const unsigned lane = threadIdx.x % warp_size;
  const unsigned near_at = lane + count_before<false>(far.depth, near.depth);
  const unsigned far_at = lane + count_before<true>(near.depth, far.depth);
  if (!write && !__any_sync(~0u, near_at != lane)) return;
  if (first + near_at < last) p.entries[first + near_at] = near.entry;
  if (first + far_at < last) p.entries[first + far_at] = far.entry;
}

/// Sorts runs of the lists' segments, and merges neighbouring halves within a segment.
__global__ void __launch_bounds__(block_size) repair_kernel(const ListRepairParams p) {
  __shared__ Member sorted[segment];
  const std::uint32_t tile = blockIdx.x / blocks_per_tile;
  const std::uint32_t last = repaired_end(p, tile);
  const unsigned lane = threadIdx.x % warp_size, warp = threadIdx.x / warp_size;
  const unsigned own = warp * run;
  for (std::uint32_t first = p.range[tile].x + blockIdx.x % blocks_per_tile * segment; first < last;
       first += blocks_per_tile * segment) {
    const bool write = __syncthreads_or(sort_run(p, first + own, last, sorted + own)) != 0;
    if (warp + 1 < warps) {
      merge_halves(p, first + own + half_run, last, sorted[own + half_run + lane],
                   sorted[own + run + lane], write);
    } else if (write) {  // the segment's ends
      for (const unsigned at : {lane, segment - half_run + lane})
        if (first + at < last) p.entries[first + at] = sorted[at].entry;
    }
    __syncthreads();
  }
}

/// Merges the halves on both sides of each segment's end.
__global__ void __launch_bounds__(block_size) join_kernel(const ListRepairParams p) {
  const std::uint32_t tile = blockIdx.x;
  const std::uint32_t last = repaired_end(p, tile);
  const unsigned lane = threadIdx.x % warp_size, warp = threadIdx.x / warp_size;
  for (std::uint32_t end = p.range[tile].x + (warp + 1) * segment; end < last;
       end += warps * segment)
    merge_halves(p, end - half_run, last, load(p, end - half_run + lane, last),
                 load(p, end + lane, last), false);
}

}  // namespace

void launch_list_repair(const ListRepairParams& params, cudaStream_t stream) {
  repair_kernel<<<params.shape.tiles() * blocks_per_tile, block_size, 0, stream>>>(params);
  check_launch("list repair");
  join_kernel<<<params.shape.tiles(), block_size, 0, stream>>>(params);
  check_launch("list repair");
}

}  // namespace catgs::cuda
