#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/list_repair.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 128;
constexpr int warps = block_size / warp_size;
// Long lists decide how long the stage takes, so several blocks share a tile.
constexpr unsigned blocks_per_tile = 8;
constexpr unsigned run = 2 * warp_size;

/// A lane's entry of a run, and its depth.
struct Member {
  TileEntry entry;
  float depth;
};

__device__ Member load(const ListRepairParams& p, std::uint32_t at, std::uint32_t last) {
  if (at >= last) return {{0, 0}, INFINITY};
  const uint2 words = reinterpret_cast<const uint2*>(p.entries)[at];
  return {{words.x, words.y}, __ldg(&p.splat_depth[words.x])};
}

/// Sorts the run of a warp that begins at `first`: each entry goes behind those that are nearer, or
/// as near and before it.
__device__ void sort_run(const ListRepairParams& p, std::uint32_t first, std::uint32_t last) {
  const unsigned lane = threadIdx.x % warp_size;
  const Member low = load(p, first + lane, last), high = load(p, first + warp_size + lane, last);
  const float next_low = __shfl_down_sync(~0u, low.depth, 1);
  const float next_high = __shfl_down_sync(~0u, high.depth, 1);
  const float first_high = __shfl_sync(~0u, high.depth, 0);
  const bool falls = low.depth > (lane + 1 < warp_size ? next_low : first_high) ||
                     (lane + 1 < warp_size && high.depth > next_high);
  if (!__any_sync(~0u, falls)) return;
  unsigned low_rank = 0, high_rank = 0;
#pragma unroll 8
  for (unsigned j = 0; j < warp_size; ++j) {
    const float a = __shfl_sync(~0u, low.depth, static_cast<int>(j));
    const float b = __shfl_sync(~0u, high.depth, static_cast<int>(j));
    low_rank += (a < low.depth || (a == low.depth && j < lane)) + (b < low.depth);
    high_rank += (a <= high.depth) + (b < high.depth || (b == high.depth && j < lane));
  }
  if (first + lane < last) p.entries[first + low_rank] = low.entry;
  if (first + warp_size + lane < last) p.entries[first + high_rank] = high.entry;
}

__global__ void __launch_bounds__(block_size) repair_kernel(const ListRepairParams p) {
  const std::uint32_t tile = blockIdx.x / blocks_per_tile;
  const uint2 range = p.range[tile];
  std::uint32_t last = range.y;
  if (p.reach != nullptr) {
    const std::uint32_t reach = p.reach[tile];
    // As far as the tile may look now.
    if (reach < range.y - range.x) last = min(last, range.x + reach + reach / 4 + 2 * run);
  }
  const std::uint32_t start = range.x + (p.shifted ? warp_size : 0);
  const std::uint32_t warp = blockIdx.x % blocks_per_tile * warps + threadIdx.x / warp_size;
  for (std::uint32_t first = start + warp * run; first < last;
       first += blocks_per_tile * warps * run)
    sort_run(p, first, min(first + run, last));
}

}  // namespace

void launch_list_repair(const ListRepairParams& params, cudaStream_t stream) {
  repair_kernel<<<params.shape.tiles() * blocks_per_tile, block_size, 0, stream>>>(params);
  check_launch("list repair");
}

}  // namespace catgs::cuda
