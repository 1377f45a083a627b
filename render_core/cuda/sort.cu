#include <algorithm>
#include <bit>

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/sort.cuh"

namespace catgs::cuda {
namespace {

/// Tile count of the k-th splat in depth order.
struct CountInOrder {
  const std::uint32_t* order;
  const std::uint32_t* tile_count;
  __device__ std::uint32_t operator()(std::uint32_t k) const { return tile_count[order[k]]; }
};

struct SaturatingSum {
  __host__ __device__ std::uint32_t operator()(std::uint32_t a, std::uint32_t b) const {
    const std::uint64_t sum = std::uint64_t{a} + b;
    return sum < list_entries_limit ? static_cast<std::uint32_t>(sum) : list_entries_limit;
  }
};

auto counts_in_order(const CountInOrder& count) {
  return thrust::make_transform_iterator(thrust::make_counting_iterator(0u), count);
}

__global__ void store_list_entries(FrameCounts* counts, HostCounts* host_counts, CountInOrder count,
                                   const std::uint32_t* first, std::uint32_t visible) {
  const std::uint32_t sum = SaturatingSum{}(first[visible - 1], count(visible - 1));
  counts->list_entries = sum;
  host_counts->list_entries = sum;
}

int tile_bits(const FrameShape& shape) { return static_cast<int>(std::bit_width(shape.tiles())); }

}  // namespace

std::size_t sort_scratch_bytes(const FrameShape& shape) {
  std::size_t depth = 0, scan = 0, narrow = 0, wide = 0;
  cub::DoubleBuffer<std::uint32_t> keys, values;
  cub::DoubleBuffer<std::uint16_t> narrow_keys;
  cub::DoubleBuffer<TileEntry> entries;
  check(cub::DeviceRadixSort::SortPairs(nullptr, depth, keys, values, shape.visible_bound, 0,
                                        depth_bits),
        "depth sort size");
  check(cub::DeviceScan::ExclusiveScan(nullptr, scan, counts_in_order({}),
                                       static_cast<std::uint32_t*>(nullptr), SaturatingSum{}, 0u,
                                       shape.visible_bound),
        "tile count scan size");
  check(cub::DeviceRadixSort::SortPairs(nullptr, wide, keys, entries, shape.list_bound, 0,
                                        tile_bits(shape)),
        "tile sort size");
  check(cub::DeviceRadixSort::SortPairs(nullptr, narrow, narrow_keys, entries, shape.list_bound, 0,
                                        std::min(tile_bits(shape), 16)),
        "tile sort size");
  return std::max({depth, scan, narrow, wide});
}

void sort_by_depth(std::uint32_t visible, PingPong<std::uint32_t>& depth,
                   PingPong<std::uint32_t>& order, SortScratch scratch, cudaStream_t stream) {
  cub::DoubleBuffer<std::uint32_t> keys(depth.current, depth.other);
  cub::DoubleBuffer<std::uint32_t> values(order.current, order.other);
  check(cub::DeviceRadixSort::SortPairs(scratch.memory, scratch.bytes, keys, values, visible, 0,
                                        depth_bits, stream),
        "depth sort");
  depth = {keys.Current(), keys.Alternate()};
  order = {values.Current(), values.Alternate()};
}

void scan_tile_counts(std::uint32_t visible, FrameCounts* counts, HostCounts* host_counts,
                      const std::uint32_t* order, const std::uint32_t* tile_count,
                      std::uint32_t* first, SortScratch scratch, cudaStream_t stream) {
  if (visible == 0) return;
  const CountInOrder count{order, tile_count};
  check(cub::DeviceScan::ExclusiveScan(scratch.memory, scratch.bytes, counts_in_order(count), first,
                                       SaturatingSum{}, 0u, visible, stream),
        "tile count scan");
  store_list_entries<<<1, 1, 0, stream>>>(counts, host_counts, count, first, visible);
  check_launch("tile count total");
}

template <class Tile>
void sort_by_tile(const FrameShape& shape, std::uint32_t entries, PingPong<Tile>& tile,
                  PingPong<TileEntry>& entry, SortScratch scratch, cudaStream_t stream) {
  cub::DoubleBuffer<Tile> keys(tile.current, tile.other);
  cub::DoubleBuffer<TileEntry> values(entry.current, entry.other);
  check(cub::DeviceRadixSort::SortPairs(scratch.memory, scratch.bytes, keys, values, entries, 0,
                                        tile_bits(shape), stream),
        "tile sort");
  tile = {keys.Current(), keys.Alternate()};
  entry = {values.Current(), values.Alternate()};
}

template void sort_by_tile(const FrameShape&, std::uint32_t, PingPong<std::uint16_t>&,
                           PingPong<TileEntry>&, SortScratch, cudaStream_t);
template void sort_by_tile(const FrameShape&, std::uint32_t, PingPong<std::uint32_t>&,
                           PingPong<TileEntry>&, SortScratch, cudaStream_t);

std::size_t sum_scratch_bytes(std::uint32_t count) {
  std::size_t bytes = 0;
  check(
      cub::DeviceScan::InclusiveScan(nullptr, bytes, static_cast<const std::uint32_t*>(nullptr),
                                     static_cast<std::uint32_t*>(nullptr), SaturatingSum{}, count),
      "tile count sum size");
  return bytes;
}

std::size_t key_sort_scratch_bytes(std::uint32_t entries, const FrameShape& shape) {
  std::size_t bytes = 0;
  cub::DoubleBuffer<std::uint64_t> keys;
  cub::DoubleBuffer<std::uint32_t> values;
  check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, values, entries, 0,
                                        32 + tile_bits(shape)),
        "key sort size");
  return bytes;
}

void sum_tile_counts(std::uint32_t count, const std::uint32_t* tile_count, std::uint32_t* sums,
                     SortScratch scratch, cudaStream_t stream) {
  check(cub::DeviceScan::InclusiveScan(scratch.memory, scratch.bytes, tile_count, sums,
                                       SaturatingSum{}, count, stream),
        "tile count sum");
}

void sort_by_key(std::uint32_t entries, const FrameShape& shape, PingPong<std::uint64_t>& key,
                 PingPong<std::uint32_t>& slot, SortScratch scratch, cudaStream_t stream) {
  cub::DoubleBuffer<std::uint64_t> keys(key.current, key.other);
  cub::DoubleBuffer<std::uint32_t> values(slot.current, slot.other);
  check(cub::DeviceRadixSort::SortPairs(scratch.memory, scratch.bytes, keys, values, entries, 0,
                                        32 + tile_bits(shape), stream),
        "key sort");
  key = {keys.Current(), keys.Alternate()};
  slot = {values.Current(), values.Alternate()};
}

}  // namespace catgs::cuda
