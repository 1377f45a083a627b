#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/occlusion.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 128;

/// The deepest end of the parts around a place in the last picture; infinity beyond its edge.
__device__ float deepest_end(const OcclusionParams& p, float x_px, float y_px) {
  const int parts_x = (p.shape.width_px + part_side_px - 1) / part_side_px;
  const int parts_y = (p.shape.height_px + part_side_px - 1) / part_side_px;
  const float x = floorf(x_px / part_side_px), y = floorf(y_px / part_side_px);
  if (!(x >= 0.0f && y >= 0.0f && x < static_cast<float>(parts_x) &&
        y < static_cast<float>(parts_y)))
    return INFINITY;
  float deepest = 0.0f;
  for (int dy = -p.radius; dy <= p.radius; ++dy) {
    for (int dx = -p.radius; dx <= p.radius; ++dx) {
      const int at_x = static_cast<int>(x) + dx, at_y = static_cast<int>(y) + dy;
      if (at_x < 0 || at_y < 0 || at_x >= parts_x || at_y >= parts_y) continue;
      deepest = fmaxf(deepest, p.last_ends[part_position(p.shape, at_x, at_y)]);
    }
  }
  return deepest;
}

__device__ float limit_of(const OcclusionParams& p, float x_px, float y_px) {
  return math::occlusion_limit<float>(p.now, p.last, {x_px, y_px},
                                      [&p](float x, float y) { return deepest_end(p, x, y); });
}

__global__ void __launch_bounds__(block_size) occlusion_kernel(const OcclusionParams p) {
  const std::uint32_t at = blockIdx.x * block_size + threadIdx.x;
  const std::uint32_t tile = at / parts_per_tile;
  if (tile >= p.shape.tiles()) return;
  const int part = static_cast<int>(at % parts_per_tile);
  const int2 corner = part_corner_px(p.shape, tile, part);
  float limit = 0.0f;  // nothing is seen beyond the picture
  if (in_picture(p.shape, corner.x, corner.y))
    limit = limit_of(p, static_cast<float>(corner.x) + 0.5f * part_side_px,
                     static_cast<float>(corner.y) + 0.5f * part_side_px);
  p.part[at] = limit;
  // The parts of a tile are lanes of one warp. The warp's other tile may not exist.
  static_assert(warp_size == 2 * parts_per_tile);
  const unsigned lanes = 0xffffu << (threadIdx.x % warp_size / parts_per_tile * parts_per_tile);
  float2 of_tile = make_float2(limit, limit);
#pragma unroll
  for (int step = parts_per_tile / 2; step > 0; step /= 2) {
    of_tile.x = fminf(of_tile.x, __shfl_xor_sync(lanes, of_tile.x, step));
    of_tile.y = fmaxf(of_tile.y, __shfl_xor_sync(lanes, of_tile.y, step));
  }
  if (part == 0) p.tile[tile] = of_tile;
}

}  // namespace

void launch_occlusion(const OcclusionParams& params, cudaStream_t stream) {
  occlusion_kernel<<<blocks_for(params.shape.tiles() * parts_per_tile, block_size), block_size, 0,
                     stream>>>(params);
  check_launch("occlusion");
}

}  // namespace catgs::cuda
