#include <cub/block/block_scan.cuh>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/pixel_runs.cuh"

namespace catgs::cuda {
namespace {

constexpr int tile_pixels = tile_size_px * tile_size_px;
constexpr int block_size = tile_pixels;

/// Position of a cell of the tile along the Hilbert curve through it.
__device__ unsigned along_hilbert(unsigned x, unsigned y) {
  unsigned place = 0;
#pragma unroll
  for (unsigned side = tile_size_px / 2; side > 0; side /= 2) {
    const bool right = (x & side) != 0, low = (y & side) != 0;
    place = place * 4 + (right ? (low ? 2u : 3u) : (low ? 1u : 0u));
    // The curve through a quarter starts and ends at the corners where its neighbours begin.
    x &= side - 1;
    y &= side - 1;
    if (low) continue;
    if (right) {
      x = side - 1 - x;
      y = side - 1 - y;
    }
    const unsigned swapped = x;
    x = y;
    y = swapped;
  }
  return place;
}

/// The pixels of the picture that may belong to a tile.
struct Candidates {
  int first_x, first_y, width, count;

  /// Pixel number k, row by row. Exact: k and width are small, and no quotient is near the next
  /// integer.
  __device__ int2 pixel(int k) const {
    const int row =
        static_cast<int>(__fdividef(static_cast<float>(k) + 0.5f, static_cast<float>(width)));
    return make_int2(first_x + k - row * width, first_y + row);
  }
};

__device__ Candidates candidates_of(const PixelRunParams& p, int tile_x, int tile_y) {
  float low_x = 1e9f, low_y = 1e9f, high_x = -1e9f, high_y = -1e9f;
#pragma unroll
  for (int corner = 0; corner < 4; ++corner) {
    const auto at = math::apply<float>(
        p.frame_from_list,
        {static_cast<float>(p.shape.first_x_px + (tile_x + corner % 2) * tile_size_px),
         static_cast<float>(p.shape.first_y_px + (tile_y + corner / 2) * tile_size_px)});
    low_x = fminf(low_x, at.x);
    low_y = fminf(low_y, at.y);
    high_x = fmaxf(high_x, at.x);
    high_y = fmaxf(high_y, at.y);
  }
  // Pixels whose centres lie inside; rounding may add some outside.
  const int first_x = max(0, static_cast<int>(floorf(low_x - 0.5f)));
  const int first_y = max(0, static_cast<int>(floorf(low_y - 0.5f)));
  const int width = min(p.shape.width_px, static_cast<int>(ceilf(high_x + 0.5f))) - first_x;
  const int height = min(p.shape.height_px, static_cast<int>(ceilf(high_y + 0.5f))) - first_y;
  return {first_x, first_y, width, width > 0 && height > 0 ? width * height : 0};
}

__global__ void __launch_bounds__(block_size) pixel_runs_kernel(const PixelRunParams p) {
  using Scan = cub::BlockScan<unsigned, block_size>;
  __shared__ Scan::TempStorage scratch;
  __shared__ unsigned in_cell[tile_pixels];  // pixels of each cell, then its first position
  const int tile = static_cast<int>(blockIdx.x), thread = static_cast<int>(threadIdx.x);
  const int tile_x = tile % p.shape.tiles_x, tile_y = tile / p.shape.tiles_x;
  const int left = p.shape.first_x_px + tile_x * tile_size_px;
  const int top = p.shape.first_y_px + tile_y * tile_size_px;
  const Candidates candidates = candidates_of(p, tile_x, tile_y);
  constexpr int most_rounds = 4;  // of candidates: a turned square in its box, with a margin
  unsigned cell[most_rounds], place[most_rounds];
  PixelPlace pixel[most_rounds];
  in_cell[thread] = 0;
  __syncthreads();
#pragma unroll
  for (int round = 0; round < most_rounds; ++round) {
    cell[round] = tile_pixels;
    const int k = round * block_size + thread;
    if (k >= candidates.count) continue;
    const int2 where = candidates.pixel(k);
    pixel[round] = {static_cast<std::uint16_t>(where.x), static_cast<std::uint16_t>(where.y)};
    const auto at = math::apply<float>(p.list_from_frame, {static_cast<float>(where.x) + 0.5f,
                                                           static_cast<float>(where.y) + 0.5f});
    const int x = static_cast<int>(floorf(at.x)) - left, y = static_cast<int>(floorf(at.y)) - top;
    if (x < 0 || y < 0 || x >= tile_size_px || y >= tile_size_px) continue;
    cell[round] = along_hilbert(static_cast<unsigned>(x), static_cast<unsigned>(y));
    place[round] = atomicAdd(&in_cell[cell[round]], 1u);
  }
  __syncthreads();
  unsigned before = 0, all = 0;
  Scan(scratch).ExclusiveSum(in_cell[thread], before, all);
  __syncthreads();
  in_cell[thread] = before;
  __syncthreads();
  const std::uint32_t bound = run_bound_px(p.shape);
  PixelPlace* run = p.pixels + static_cast<std::size_t>(tile) * bound;
#pragma unroll
  for (int round = 0; round < most_rounds; ++round) {
    if (cell[round] == tile_pixels) continue;
    const unsigned at = in_cell[cell[round]] + place[round];
    if (at < bound) run[at] = pixel[round];
  }
  if (thread == 0) p.pixel_count[tile] = min(all, bound);
}

}  // namespace

void launch_pixel_runs(const PixelRunParams& params, cudaStream_t stream) {
  pixel_runs_kernel<<<params.shape.tiles(), block_size, 0, stream>>>(params);
  check_launch("pixel runs");
}

}  // namespace catgs::cuda
