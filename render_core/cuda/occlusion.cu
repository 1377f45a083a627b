#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/occlusion.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 128;

/// The deepest end of the parts around a place in the last picture; infinity beyond its edge.
__device__ float deepest_end(const OcclusionParams& p, float x_px, float y_px) {
  const FrameShape& last = p.last.shape;
  const int left = last.left_px / part_side_px, top = last.top_px / part_side_px;
  const int right = (last.left_px + last.width_px - 1) / part_side_px;
  const int bottom = (last.top_px + last.height_px - 1) / part_side_px;
  const float x = floorf(x_px / part_side_px), y = floorf(y_px / part_side_px);
  if (!(x_px >= static_cast<float>(last.left_px) && y_px >= static_cast<float>(last.top_px) &&
        x <= static_cast<float>(right) && y <= static_cast<float>(bottom)))
    return INFINITY;
  float deepest = 0.0f;
  for (int dy = -p.radius; dy <= p.radius; ++dy) {
    for (int dx = -p.radius; dx <= p.radius; ++dx) {
      const int at_x = static_cast<int>(x) + dx, at_y = static_cast<int>(y) + dy;
      if (at_x < left || at_y < top || at_x > right || at_y > bottom) continue;
      deepest = fmaxf(deepest, p.last_ends[part_position(last, at_x, at_y)]);
    }
  }
  return deepest;
}

/// The limit of the part around a place, as a view depth of the frame's camera.
__device__ float limit_of(const OcclusionParams& p, float x_px, float y_px) {
  const auto seen_from = [&](const math::CameraModel<float>& camera) {
    return math::occlusion_limit<float>(camera, p.last.camera, {x_px, y_px},
                                        [&p](float x, float y) { return deepest_end(p, x, y); });
  };
  const float now = seen_from(p.now);
  if (!p.sweeps || !(now < INFINITY)) return now;
  const float end = seen_from(p.end);
  if (!(end < INFINITY)) return end;
  const auto ray = math::carried_ray<float>(p.end, p.now, {x_px, y_px});
  return fmaxf(now, ray.at(end).z);
}

__global__ void __launch_bounds__(block_size) occlusion_kernel(const OcclusionParams p) {
  const std::uint32_t at = blockIdx.x * block_size + threadIdx.x;
  const std::uint32_t tile = at / parts_per_tile;
  if (tile >= p.shape.tiles()) return;
  const int part = static_cast<int>(at % parts_per_tile);
  const int2 corner = part_corner_px(p.shape, tile, part);
  float limit = 0.0f;  // nothing is seen beyond the pictures
  if (corner.x > p.shown.x - part_side_px && corner.y > p.shown.y - part_side_px &&
      corner.x < p.shown.z && corner.y < p.shown.w)
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
