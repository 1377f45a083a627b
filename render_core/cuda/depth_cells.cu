#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/depth_cells.cuh"
#include "render_core/math/blend-inl.h"
#include "render_core/math/ellipse-inl.h"

namespace catgs::cuda {
namespace {

constexpr int pixels_per_cell = 4;
constexpr int block_size = pixels_per_cell * warp_size;
constexpr unsigned all_lanes = 0xffffffffu;

struct DepthParams {
  DepthSource source;
  int columns, rows;
  float* inverse_depths;  // [rows][columns]
};

/// The depth at which half of the light of a pixel of the grid is stopped; infinity where less is.
/// For a whole warp.
__device__ float half_depth(const DepthSource& s, int x_px, int y_px) {
  const int lane = static_cast<int>(threadIdx.x % warp_size);
  const int tile = y_px / tile_side_px * s.shape.tiles_x + x_px / tile_side_px;
  const int block =
      y_px % tile_side_px / block_height_px * blocks_across + x_px % tile_side_px / block_width_px;
  const uint2 range = s.range[tile];
  float transmittance = 1.0f;  // before the entries of this round
  for (std::uint32_t first = range.x; first < range.y; first += warp_size) {
    const std::uint32_t at = first + static_cast<unsigned>(lane);
    float passes = 1.0f;
    std::uint32_t slot = 0;
    if (at < range.y) {
      const TileEntry entry = s.entries[at];
      slot = entry.slot;
      if ((entry.blocks >> block & 1u) != 0) {
        const SplatRecord record = s.records[slot];
        const float square = math::whitened_square<float>(
            record.whitening, {static_cast<float>(x_px) + 0.5f - record.centre_px.x,
                               static_cast<float>(y_px) + 0.5f - record.centre_px.y});
        passes = 1.0f - math::alpha_of(record.log2_opacity - square);
      }
    }
#pragma unroll
    for (int step = 1; step < warp_size; step *= 2) {
      const float before = __shfl_up_sync(all_lanes, passes, static_cast<unsigned>(step));
      if (lane >= step) passes *= before;
    }
    const unsigned stops = __ballot_sync(all_lanes, transmittance * passes < 0.5f);
    if (stops != 0)
      return s.splat_depth[__shfl_sync(all_lanes, slot, __ffs(static_cast<int>(stops)) - 1)];
    transmittance *= __shfl_sync(all_lanes, passes, warp_size - 1);
  }
  return INFINITY;
}

/// A block makes a cell, and a warp one of its pixels.
__global__ void __launch_bounds__(block_size) depth_kernel(const DepthParams p) {
  __shared__ float found[pixels_per_cell];
  const int cell = static_cast<int>(blockIdx.x), warp = static_cast<int>(threadIdx.x / warp_size);
  // Pixels in the middles of the quarters of the cell.
  const int quarter_x = 4 * (cell % p.columns) + 1 + warp % 2 * 2;
  const int quarter_y = 4 * (cell / p.columns) + 1 + warp / 2 * 2;
  const FrameShape& shape = p.source.shape;
  const int x_px = shape.left_px + quarter_x * shape.width_px / (4 * p.columns);
  const int y_px = shape.top_px + quarter_y * shape.height_px / (4 * p.rows);
  const float depth = half_depth(p.source, x_px, y_px);
  if (threadIdx.x % warp_size == 0) found[warp] = 1.0f / depth;
  __syncthreads();
  if (threadIdx.x != 0) return;
  const float a = found[0], b = found[1], c = found[2], d = found[3];
  const float low = fmaxf(fminf(a, b), fminf(c, d));
  p.inverse_depths[cell] = fmaxf(low, fminf(fmaxf(a, b), fmaxf(c, d)));
}

}  // namespace

void DepthCells::find(const DepthSource& source, glm::ivec2 cells, cudaStream_t stream) {
  cells_ = cells;
  const auto count = static_cast<std::uint32_t>(cells.x * cells.y);
  if (count == 0) return;
  device_.reserve(count);
  host_.reserve(count);
  depth_kernel<<<count, block_size, 0, stream>>>(
      {.source = source, .columns = cells.x, .rows = cells.y, .inverse_depths = device_.get()});
  check_launch("depths");
  check(cudaMemcpyAsync(host_.get(), device_.get(), count * sizeof(float), cudaMemcpyDeviceToHost,
                        stream),
        "depths");
}

DepthGrid DepthCells::grid() const {
  const auto count = static_cast<std::size_t>(cells_.x * cells_.y);
  return {cells_, {host_.get(), count}};
}

}  // namespace catgs::cuda
