#include "render_core/cuda/bin.cuh"
#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/tiles.cuh"
#include "render_core/cuda/warp_sums.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 512;
constexpr int warps = block_size / warp_size;

// Every splat of a window has its first entry in it, except one that began before.
constexpr std::uint32_t most_splats = list_window + 1;

/// List entries while they are made: their tile's row << 16 | column, and their splat's slot.
struct Window {
  std::uint32_t begin, end;  // list entries
  std::uint32_t position[list_window];
  std::uint32_t slot[list_window];

  /// Writes a row's entries from `at` on, as far as they are before `last` and in the window.
  /// Returns the first entry of the next row.
  __device__ std::uint32_t put_row(int row, int2 columns, std::uint32_t splat, std::uint32_t at,
                                   std::uint32_t last) {
    const std::uint32_t stop = min(last, end);
    for (int column = columns.x; column <= columns.y; ++column, ++at) {
      if (at < begin || at >= stop) continue;
      position[at - begin] = static_cast<std::uint32_t>(row << 16 | column);
      slot[at - begin] = splat;
    }
    return at;
  }
};

/// In place of an entry that no splat wrote.
constexpr std::uint32_t nowhere = ~0u;

/// The first k in [0, count) whose entries begin after `at`. Found by one warp with 32 probes at a
/// time.
__device__ std::uint32_t first_beyond(const std::uint32_t* first, std::uint32_t count,
                                      std::uint32_t at) {
  const std::uint32_t lane = threadIdx.x % warp_size;
  std::uint32_t low = 0, high = count;  // the answer is in [low, high]
  while (low < high) {
    const std::uint32_t step = (high - low + warp_size - 1) / warp_size;
    const std::uint32_t probe = low + step * (lane + 1) - 1;
    const bool beyond = probe >= high || first[probe] > at;
    const unsigned lanes = __ballot_sync(~0u, beyond);
    const std::uint32_t hit = lanes == 0 ? warp_size : __ffs(static_cast<int>(lanes)) - 1;
    const std::uint32_t new_low = low + step * hit;
    high = hit == warp_size ? high : min(high, new_low + step - 1);
    low = min(new_low, high);
  }
  return low;
}

// Another kernel counted the tiles of large splats, and compilers may round the same formula
// differently there. With half the slack here, every tile that is found was counted. Tiles that
// were counted but are not found stay padding.
constexpr float emit_slack_px = 0.5f * least_slack_px;

/// How much wider than its path a splat is listed, px.
template <class Tile>
__device__ float slack_of(const EmitParams<Tile>& p, std::uint32_t slot) {
  return p.splat_depth != nullptr ? p.slack.at(p.splat_depth[slot]) : 0.0f;
}

/// All lanes write one splat. Rows stay in order, so that the list is the same as if a single lane
/// wrote it.
template <class Tile, class Outline>
__device__ void emit_together(const EmitParams<Tile>& p, Window& window,
                              const TileFootprint<Outline>& f, std::uint32_t slot,
                              std::uint32_t at) {
  const std::uint32_t last = at + p.tile_count[slot];
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  for (int top = f.first_row; top <= f.last_row && at < window.end; top += warp_size) {
    const int row = top + lane;
    const int2 columns = row <= f.last_row ? f.columns(row) : make_int2(0, -1);
    const std::uint32_t count = static_cast<std::uint32_t>(max(0, columns.y - columns.x + 1));
    const WarpSums<std::uint32_t> counts = warp_sums(count);
    window.put_row(row, columns, slot, at + counts.before, last);
    at += counts.all;
  }
}

template <class Tile>
__device__ void emit_large(const EmitParams<Tile>& p, Window& window, std::uint32_t slot,
                           std::uint32_t at) {
  if (p.path != nullptr) {
    with_footprint(p.path[slot], p.shape, emit_slack_px + slack_of(p, slot),
                   [&](const auto& footprint) { emit_together(p, window, footprint, slot, at); });
  } else {
    const SplatRecord& r = p.records[slot];
    emit_together(p, window,
                  make_footprint(r.centre_px, r.whitening, r.log2_opacity, p.shape, emit_slack_px),
                  slot, at);
  }
}

/// The blocks of parts that end before `depth`.
__device__ std::uint32_t hidden_blocks(const float* part_limit, float depth) {
  std::uint32_t hidden = 0;
#pragma unroll
  for (int part = 0; part < parts_per_tile; part += 4) {
    const float4 limit = __ldg(reinterpret_cast<const float4*>(&part_limit[part]));
    if (depth > limit.x) hidden |= blocks_of(part);
    if (depth > limit.y) hidden |= blocks_of(part + 1);
    if (depth > limit.z) hidden |= blocks_of(part + 2);
    if (depth > limit.w) hidden |= blocks_of(part + 3);
  }
  return hidden;
}

/// TileEntry::blocks of a splat in a tile, without blocks where it is hidden.
template <class Tile>
__device__ std::uint32_t blocks_of_entry(const EmitParams<Tile>& p, int column, int row,
                                         std::uint32_t tile, std::uint32_t slot) {
  std::uint32_t blocks = 0;
  if (p.path != nullptr) {
    blocks = blocks_of(p.path[slot], p.shape, column, row, least_slack_px + slack_of(p, slot));
  } else {
    const SplatRecord& r = p.records[slot];
    blocks = blocks_of(r.centre_px, r.whitening, r.log2_opacity, column, row);
  }
  if (p.occlusion.part == nullptr) return blocks;
  const float depth = p.splat_depth[slot];
  if (!(depth > p.occlusion.tile[tile].x)) return blocks;
  return blocks & ~hidden_blocks(&p.occlusion.part[std::size_t{tile} * parts_per_tile], depth);
}

template <class Tile>
__global__ void __launch_bounds__(block_size) emit_kernel(const EmitParams<Tile> p) {
  extern __shared__ std::uint32_t dynamic[];
  std::uint32_t* large = dynamic;                  // [most_splats], places in the order
  std::uint32_t* in_tile = dynamic + most_splats;  // [counted], the window's entries in each tile
  __shared__ Window window;
  __shared__ std::uint32_t splats[2];  // in depth order: range of splats in the window
  __shared__ std::uint32_t large_count;
  const std::uint32_t thread = threadIdx.x;
  const std::uint32_t begin = blockIdx.x * list_window;
  const std::uint32_t end = min(begin + list_window, p.shape.list_bound);
  const std::uint32_t visible = min(p.counts->visible, p.shape.visible_bound);
  if (begin >= p.counts->list_entries) return;
  if (thread / warp_size < 2) {
    // From the last splat that begins at or before the window, to the last one that begins in it.
    const std::uint32_t beyond =
        first_beyond(p.first, visible, thread < warp_size ? begin : end - 1);
    if (thread % warp_size == 0)
      splats[thread / warp_size] = thread < warp_size ? max(beyond, 1u) - 1 : beyond;
  }
  for (std::uint32_t j = thread; j < list_window; j += block_size) window.position[j] = nowhere;
  const std::uint32_t counted = p.in_window != nullptr ? p.shape.tiles() : 0;
  for (std::uint32_t t = thread; t < counted; t += block_size) in_tile[t] = 0;
  if (thread == 0) {
    window.begin = begin;
    window.end = end;
    large_count = 0;
  }
  __syncthreads();
  for (std::uint32_t k = splats[0] + thread; k < splats[1]; k += block_size) {
    const std::uint32_t slot = p.order[k];
    std::uint32_t at = p.first[k];
    const TileSpans spans = p.spans[slot];
    if (spans.rows() == TileSpans::not_small) {
      if (p.tile_count[slot] > 0) large[atomicAdd(&large_count, 1u)] = k;
      continue;
    }
#pragma unroll
    for (int j = 0; j < TileSpans::most_rows; ++j) {
      if (j >= static_cast<int>(spans.rows())) break;
      const int first = static_cast<int>(spans.column()) + spans.first(j);
      at = window.put_row(static_cast<int>(spans.row()) + j,
                          make_int2(first, first + spans.count(j) - 1), slot, at, end);
    }
  }
  __syncthreads();
  for (std::uint32_t j = thread / warp_size; j < large_count; j += warps) {
    const std::uint32_t k = large[j];
    emit_large(p, window, p.order[k], p.first[k]);
  }
  __syncthreads();
  for (std::uint32_t at = begin + thread; at < end; at += block_size) {
    const std::uint32_t position = window.position[at - begin], slot = window.slot[at - begin];
    std::uint32_t tile = p.shape.tiles(), blocks = 0;
    if (position != nowhere) {
      const int column = static_cast<int>(position & 0xffffu),
                row = static_cast<int>(position >> 16);
      tile = static_cast<std::uint32_t>(row * p.shape.tiles_x + column);
      blocks = blocks_of_entry(p, column, row, tile, slot);
    }
    if (blocks == 0) tile = p.shape.tiles();  // padding
    p.tile[at] = static_cast<Tile>(tile);
    p.entry[at] = {blocks == 0 ? 0 : slot, blocks};
    if (tile < counted) atomicAdd(&in_tile[tile], 1u);
  }
  if (counted == 0) return;
  __syncthreads();
  for (std::uint32_t t = thread; t < counted; t += block_size)
    p.in_window[std::size_t{blockIdx.x} * counted + t] = in_tile[t];
}

/// Four entries a thread.
constexpr std::uint32_t range_step = 4;

template <class Tile>
__global__ void __launch_bounds__(block_size) ranges_kernel(const RangesParams<Tile> p) {
  const std::uint32_t first = (blockIdx.x * block_size + threadIdx.x) * range_step;
  if (first >= p.entries) return;
  const std::uint32_t tiles = p.shape.tiles();  // padding, and positions beyond the ends
  std::uint32_t before = first > 0 ? p.tile[first - 1] : tiles;
#pragma unroll
  for (std::uint32_t j = 0; j < range_step; ++j) {
    const std::uint32_t i = first + j;
    const std::uint32_t tile = i < p.entries ? p.tile[i] : tiles;
    if (tile != before) {
      if (before < tiles) p.range[before].y = i;
      if (tile < tiles) p.range[tile].x = i;
    }
    before = tile;
  }
  if (first + range_step >= p.entries && before < tiles) p.range[before].y = p.entries;
}

}  // namespace

template <class Tile>
void launch_emit(const EmitParams<Tile>& params, cudaStream_t stream) {
  const std::uint32_t counted = params.in_window != nullptr ? params.shape.tiles() : 0;
  const std::size_t shared_bytes = (most_splats + counted) * sizeof(std::uint32_t);
  // The attribute belongs to the device, not to the launch: other Views may draw other sizes.
  constexpr std::size_t most_shared_bytes =
      (most_splats + most_sorted_tiles) * sizeof(std::uint32_t);
  check(cudaFuncSetAttribute(emit_kernel<Tile>, cudaFuncAttributeMaxDynamicSharedMemorySize,
                             static_cast<int>(most_shared_bytes)),
        "emit");
  emit_kernel<<<blocks_for(params.shape.list_bound, list_window), block_size, shared_bytes,
                stream>>>(params);
  check_launch("emit");
}

template <class Tile>
void launch_ranges(const RangesParams<Tile>& params, cudaStream_t stream) {
  check(cudaMemsetAsync(params.range, 0, params.shape.tiles() * sizeof(uint2), stream), "ranges");
  if (params.entries == 0) return;
  constexpr std::uint32_t per_block = block_size * range_step;
  ranges_kernel<<<blocks_for(params.entries, per_block), block_size, 0, stream>>>(params);
  check_launch("ranges");
}

template void launch_emit(const EmitParams<std::uint16_t>&, cudaStream_t);
template void launch_emit(const EmitParams<std::uint32_t>&, cudaStream_t);
template void launch_ranges(const RangesParams<std::uint16_t>&, cudaStream_t);
template void launch_ranges(const RangesParams<std::uint32_t>&, cudaStream_t);

}  // namespace catgs::cuda
