#include <bit>

#include <cub/block/block_scan.cuh>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/tile_sort.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 512;
constexpr int warps = block_size / warp_size;
constexpr int rounds = list_window / block_size;
constexpr std::uint32_t warp_entries = list_window / warps;

__host__ __device__ std::uint32_t windows_of(std::uint32_t entries) {
  return (entries + list_window - 1) / list_window;
}

__device__ std::uint32_t listed(const TileSortParams& p) {
  return min(p.counts->list_entries, p.shape.list_bound);
}

constexpr int sum_rows = 32;

/// in_window[window][tile] becomes the number of the tile's entries in earlier windows; range[tile]
/// becomes {0, number of all}. A warp sums 32 tiles over its share of the windows.
__global__ void __launch_bounds__(warp_size* sum_rows) sum_kernel(const TileSortParams p) {
  __shared__ std::uint32_t sums[sum_rows][warp_size];
  const std::uint32_t tiles = p.shape.tiles(), windows = windows_of(listed(p));
  const std::uint32_t lane = threadIdx.x % warp_size, share = threadIdx.x / warp_size;
  const std::uint32_t t = blockIdx.x * warp_size + lane;
  const std::uint32_t first = windows * share / sum_rows, last = windows * (share + 1) / sum_rows;
  std::uint32_t* column = p.in_window + min(t, tiles - 1);
  std::uint32_t sum = 0;
#pragma unroll 16
  for (std::uint32_t w = first; w < last; ++w) sum += column[std::size_t{w} * tiles];
  sums[share][lane] = sum;
  __syncthreads();
  std::uint32_t before = 0, all = 0;
#pragma unroll
  for (std::uint32_t s = 0; s < sum_rows; ++s) {
    if (s < share) before += sums[s][lane];
    all += sums[s][lane];
  }
  if (t >= tiles) return;
  // Several at a time: a load does not pass an earlier store.
  constexpr std::uint32_t step = 8;
  for (std::uint32_t w = first; w < last; w += step) {
    std::uint32_t count[step];
#pragma unroll
    for (std::uint32_t j = 0; j < step; ++j)
      count[j] = w + j < last ? column[std::size_t{w + j} * tiles] : 0;
#pragma unroll
    for (std::uint32_t j = 0; j < step; ++j) {
      if (w + j < last) column[std::size_t{w + j} * tiles] = before;
      before += count[j];
    }
  }
  if (share == 0) p.range[t] = make_uint2(0, all);
}

constexpr int range_block = 1024;
constexpr int range_items = (most_sorted_tiles + range_block - 1) / range_block;

/// Ranges of lengths become ranges one after another.
__global__ void __launch_bounds__(range_block) range_kernel(const TileSortParams p) {
  using Scan = cub::BlockScan<std::uint32_t, range_block>;
  __shared__ Scan::TempStorage scratch;
  const std::uint32_t tiles = p.shape.tiles(), first = threadIdx.x * range_items;
  std::uint32_t length[range_items], begin[range_items];
#pragma unroll
  for (std::uint32_t j = 0; j < range_items; ++j)
    length[j] = first + j < tiles ? p.range[first + j].y : 0;
  Scan(scratch).ExclusiveSum(length, begin);
#pragma unroll
  for (std::uint32_t j = 0; j < range_items; ++j)
    if (first + j < tiles) p.range[first + j] = make_uint2(begin[j], begin[j] + length[j]);
}

/// The lanes that have the same tile, bit by bit. Where most lanes differ, __match_any_sync() takes
/// longer: the kernel took 80 us with it, and takes 52 us so (one H200, 4.1 million entries).
__device__ unsigned lanes_with(std::uint32_t tile) {
  constexpr int bits = std::bit_width(most_sorted_tiles);
  unsigned lanes = ~0u;
#pragma unroll
  for (int b = 0; b < bits; ++b) {
    const bool set = (tile >> b & 1u) != 0;
    const unsigned with = __ballot_sync(~0u, set);
    lanes &= set ? with : ~with;
  }
  return lanes;
}

constexpr std::size_t scatter_bytes(std::uint32_t tiles) {
  return tiles * (sizeof(std::uint32_t) + warps * sizeof(std::uint16_t));
}

static_assert(scatter_bytes(most_sorted_tiles) <= 99 * 1024);

/// Writes each entry to its place: after those of its tile in earlier windows, in earlier warps of
/// the window, and earlier ones of its warp.
__global__ void __launch_bounds__(block_size) scatter_kernel(const TileSortParams p) {
  extern __shared__ std::uint32_t start[];  // [tiles], then counts [warps][tiles]
  const std::uint32_t tiles = p.shape.tiles(), entries = listed(p);
  if (blockIdx.x * list_window >= entries) return;
  const std::uint32_t lane = threadIdx.x % warp_size, warp = threadIdx.x / warp_size;
  auto* counts = reinterpret_cast<std::uint16_t*>(&start[tiles]);
  std::uint16_t* count = &counts[warp * tiles];
  const std::uint32_t* row = &p.in_window[std::size_t{blockIdx.x} * tiles];
  for (std::uint32_t t = threadIdx.x; t < tiles; t += block_size) {
    start[t] = p.range[t].x + row[t];
#pragma unroll
    for (int w = 0; w < warps; ++w) counts[w * tiles + t] = 0;
  }
  __syncthreads();
  const std::uint32_t first = blockIdx.x * list_window + warp * warp_entries + lane;
  std::uint32_t tile[rounds], rank[rounds];
#pragma unroll
  for (int j = 0; j < rounds; ++j) {
    const std::uint32_t at = first + j * warp_size;
    tile[j] = at < entries ? p.tile[at] : tiles;
  }
#pragma unroll
  for (int j = 0; j < rounds; ++j) {
    const unsigned peers = lanes_with(tile[j]);
    const bool present = tile[j] < tiles;
    const std::uint32_t before = present ? count[tile[j]] : 0;
    rank[j] = before + __popc(peers & ((1u << lane) - 1u));
    __syncwarp();
    if (present && (peers >> lane) == 1u)
      count[tile[j]] = static_cast<std::uint16_t>(before + __popc(peers));
    __syncwarp();
  }
  __syncthreads();
  for (std::uint32_t t = threadIdx.x; t < tiles; t += block_size) {
    std::uint32_t before = 0;
#pragma unroll
    for (int w = 0; w < warps; ++w) {
      const std::uint32_t n = counts[w * tiles + t];
      counts[w * tiles + t] = static_cast<std::uint16_t>(before);
      before += n;
    }
  }
  __syncthreads();
#pragma unroll
  for (int j = 0; j < rounds; ++j) {
    if (tile[j] >= tiles) continue;
    p.entry[start[tile[j]] + count[tile[j]] + rank[j]] = p.unsorted[first + j * warp_size];
  }
}

}  // namespace

std::size_t window_tiles(const FrameShape& shape) {
  return std::size_t{windows_of(shape.list_bound)} * std::min(shape.tiles(), most_sorted_tiles);
}

void launch_tile_sort(const TileSortParams& params, cudaStream_t stream) {
  const std::uint32_t tiles = params.shape.tiles(), windows = windows_of(params.shape.list_bound);
  sum_kernel<<<blocks_for(tiles, warp_size), warp_size * sum_rows, 0, stream>>>(params);
  check_launch("tile count sums");
  range_kernel<<<1, range_block, 0, stream>>>(params);
  check_launch("ranges");
  // The attribute belongs to the device, not to the launch: other Views may draw other sizes.
  check(cudaFuncSetAttribute(scatter_kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                             static_cast<int>(scatter_bytes(most_sorted_tiles))),
        "tile sort");
  scatter_kernel<<<windows, block_size, scatter_bytes(tiles), stream>>>(params);
  check_launch("tile sort");
}

}  // namespace catgs::cuda
