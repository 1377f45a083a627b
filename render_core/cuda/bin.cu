#include "render_core/cuda/bin.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/tiles.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 256;

// A splat with more rows than this is written by its whole warp, a row a lane.
constexpr int lone_rows = 4;

/// Writes a row's entries from `at` on, never past `end`, and returns where the next row's begin.
__device__ std::uint32_t emit_row(const EmitParams& p, int row, int2 columns, std::uint32_t slot,
                                  std::uint32_t at, std::uint32_t end) {
  for (int column = columns.x; column <= columns.y; ++column, ++at) {
    if (at >= end) continue;
    p.tile[at] = static_cast<std::uint32_t>(row * p.shape.tiles_x + column);
    p.slot[at] = slot;
  }
  return at;
}

__device__ TileFootprint footprint_of(const EmitParams& p, std::uint32_t slot) {
  const SplatRecord& r = p.records[slot];
  return make_footprint(r.centre_px, r.whitening, r.log2_opacity, p.shape);
}

/// Where a splat's entries end. Its tiles were counted by another kernel, and compilers may round
/// the same formula differently there: entries counted but not written become padding.
__device__ std::uint32_t entries_end(const EmitParams& p, std::uint32_t slot, std::uint32_t at) {
  return min(at + p.tile_count[slot], p.shape.list_bound);
}
__device__ void pad_entry(const EmitParams& p, std::uint32_t at) {
  p.tile[at] = p.shape.tiles();
  p.slot[at] = 0;
}
__device__ void pad_rest(const EmitParams& p, std::uint32_t at, std::uint32_t end) {
  for (; at < end; ++at) pad_entry(p, at);
}

/// All lanes write one splat; rows in order, so that the list is the same as a lone lane's.
__device__ void emit_together(const EmitParams& p, std::uint32_t slot, std::uint32_t at) {
  const std::uint32_t end = entries_end(p, slot, at);
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const TileFootprint f = footprint_of(p, slot);
  for (int top = f.first_row; top <= f.last_row; top += warp_size) {
    const int row = top + lane;
    const int2 columns = row <= f.last_row ? f.columns(row) : make_int2(0, -1);
    const std::uint32_t count = static_cast<std::uint32_t>(max(0, columns.y - columns.x + 1));
    std::uint32_t before = count;  // inclusive scan over the warp
#pragma unroll
    for (int step = 1; step < warp_size; step *= 2) {
      const std::uint32_t other = __shfl_up_sync(~0u, before, step);
      if (lane >= step) before += other;
    }
    emit_row(p, row, columns, slot, at + before - count, end);
    at += __shfl_sync(~0u, before, warp_size - 1);
  }
  if (lane == 0) pad_rest(p, at, end);
}

__global__ void __launch_bounds__(block_size) emit_kernel(const EmitParams p) {
  const std::uint32_t k = blockIdx.x * block_size + threadIdx.x;
  const bool live = k < min(p.counts->visible, p.shape.visible_bound);
  std::uint32_t slot = 0, at = 0;
  bool large = false;
  if (live) {
    slot = p.order[k];
    at = p.first[k];
    const TileFootprint f = footprint_of(p, slot);
    large = f.last_row - f.first_row >= lone_rows;
    if (!large) {
      const std::uint32_t end = entries_end(p, slot, at);
      for (int row = f.first_row; row <= f.last_row; ++row)
        at = emit_row(p, row, f.columns(row), slot, at, end);
      pad_rest(p, at, end);
    }
  }
  for (unsigned left = __ballot_sync(~0u, large); left != 0; left &= left - 1) {
    const int source = __ffs(static_cast<int>(left)) - 1;
    emit_together(p, __shfl_sync(~0u, slot, source), __shfl_sync(~0u, at, source));
  }
}

__global__ void __launch_bounds__(block_size) pad_kernel(const EmitParams p) {
  const std::uint32_t at = p.counts->list_entries + blockIdx.x * block_size + threadIdx.x;
  for (std::uint32_t i = at; i < p.shape.list_bound; i += gridDim.x * block_size) pad_entry(p, i);
}

__global__ void __launch_bounds__(block_size) ranges_kernel(const RangesParams p) {
  const std::uint32_t i = blockIdx.x * block_size + threadIdx.x;
  if (i >= p.shape.list_bound) return;
  const std::uint32_t tile = p.tile[i];
  if (tile >= p.shape.tiles()) return;  // padding
  if (i == 0 || p.tile[i - 1] != tile) p.range[tile].x = i;
  if (i + 1 == p.shape.list_bound || p.tile[i + 1] != tile) p.range[tile].y = i + 1;
}

}  // namespace

void launch_emit(const EmitParams& params, cudaStream_t stream) {
  const std::uint32_t blocks = (params.shape.visible_bound + block_size - 1) / block_size;
  emit_kernel<<<blocks, block_size, 0, stream>>>(params);
  check_launch("emit");
  pad_kernel<<<512, block_size, 0, stream>>>(params);
  check_launch("list padding");
}

void launch_ranges(const RangesParams& params, cudaStream_t stream) {
  check(cudaMemsetAsync(params.range, 0, params.shape.tiles() * sizeof(uint2), stream), "ranges");
  const std::uint32_t blocks = (params.shape.list_bound + block_size - 1) / block_size;
  ranges_kernel<<<blocks, block_size, 0, stream>>>(params);
  check_launch("ranges");
}

}  // namespace catgs::cuda
