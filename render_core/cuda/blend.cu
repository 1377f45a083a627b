#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/math/blend-inl.h"
#include "render_core/math/constants.h"

namespace catgs::cuda {
namespace {

// A block is a tile, a warp its 8x4 part: small enough that most splats of a tile miss most warps.
constexpr int warp_width_px = 8;
constexpr int warp_height_px = 4;
constexpr int block_size = tile_size_px * tile_size_px;

/// A splat staged for one tile, coordinates from the tile's corner: small numbers keep the
/// whitened distance exact to 1e-5.
struct __align__(16) StagedSplat {
  float4 shape;  // centre x, y (px), whitening xx, xy
  float4 rest;   // whitening yy, log2 opacity, red and green as half2, blue as half
};

/// Whether the splat reaches alpha_min at a pixel centre's distance of the box with corners `low`
/// and `high` (px, relative to the centre): the ellipse's cut through the box's rows must meet its
/// columns. The same cut as math::columns_in_band, minimised over the box without square roots.
__device__ bool reaches_box(const float4& shape, const float4& rest, float2 low, float2 high) {
  const float xx = shape.z, xy = shape.w, yy = rest.x;
  const float reach = math::reach_of(rest.y) + 1e-3f;
  // The box point nearest to the centre in x, then the best y for it, and the other way round: the
  // minimum of a convex quadratic over a box lies on one of these two lines or at the centre.
  const float x = math::clamp(0.0f, low.x, high.x);
  const float y = math::clamp(0.0f, low.y, high.y);
  const float cross = xx * xy;
  const float y_for_x = math::clamp(__fdividef(-cross * x, xy * xy + yy * yy), low.y, high.y);
  const float x_for_y = math::clamp(__fdividef(-xy * y, xx), low.x, high.x);
  const math::Whitening<float> w{xx, xy, yy};
  const float along_x = math::whitened_square<float>(w, {x, y_for_x});
  const float along_y = math::whitened_square<float>(w, {x_for_y, y});
  return fminf(along_x, along_y) <= reach;
}

__device__ math::Vec3<float> colour_of(const float4& rest) {
  const float2 red_green = __half22float2(reinterpret_cast<const __half2&>(rest.z));
  const float blue = __low2float(reinterpret_cast<const __half2&>(rest.w));
  return {red_green.x, red_green.y, blue};
}

__device__ StagedSplat stage(const SplatRecord* records, std::uint32_t slot, float2 corner) {
  const float4* words = reinterpret_cast<const float4*>(&records[slot]);
  float4 shape = __ldg(&words[0]);
  const float4 rest = __ldg(&words[1]);
  shape.x -= corner.x;
  shape.y -= corner.y;
  return {shape, rest};
}

template <bool count_pairs>
__global__ void __launch_bounds__(block_size) blend_kernel(const BlendParams p) {
  __shared__ StagedSplat staged[block_size];
  const int tile = static_cast<int>(blockIdx.x);
  const int thread = static_cast<int>(threadIdx.x);
  const int lane = thread % warp_size;
  const int warp = thread / warp_size;
  const float2 corner = make_float2(static_cast<float>(tile % p.shape.tiles_x * tile_size_px),
                                    static_cast<float>(tile / p.shape.tiles_x * tile_size_px));
  constexpr int warps_across = tile_size_px / warp_width_px;
  const int warp_x = warp % warps_across * warp_width_px;
  const int warp_y = warp / warps_across * warp_height_px;
  const int in_tile_x = warp_x + lane % warp_width_px;
  const int in_tile_y = warp_y + lane / warp_width_px;
  const int px = static_cast<int>(corner.x) + in_tile_x;
  const int py = static_cast<int>(corner.y) + in_tile_y;
  const bool inside = px < p.shape.width_px && py < p.shape.height_px;
  const float2 centre =
      make_float2(static_cast<float>(in_tile_x) + 0.5f, static_cast<float>(in_tile_y) + 0.5f);
  const float2 box_low =
      make_float2(static_cast<float>(warp_x) + 0.5f, static_cast<float>(warp_y) + 0.5f);
  const float2 box_high =
      make_float2(box_low.x + (warp_width_px - 1), box_low.y + (warp_height_px - 1));

  auto pixel = math::empty_pixel<float>();
  if (!inside) pixel.transmittance = -1.0f;
  bool warp_live = __any_sync(~0u, inside);
  const uint2 range = p.range[tile];
  if (thread == 0) atomicMax(&p.counts->list_max, range.y - range.x);
  unsigned long long pairs = 0;
  for (std::uint32_t first = range.x; first < range.y; first += block_size) {
    if (__syncthreads_or(warp_live) == 0) break;
    const std::uint32_t at = first + static_cast<std::uint32_t>(thread);
    if (at < range.y) staged[thread] = stage(p.records, p.slot[at], corner);
    __syncthreads();
    if (!warp_live) continue;
    const int count =
        static_cast<int>(min(range.y - first, static_cast<std::uint32_t>(block_size)));
    for (int group = 0; group < count && warp_live; group += warp_size) {
      bool hit = false;
      if (group + lane < count) {
        const float4 shape = staged[group + lane].shape;
        const float4 rest = staged[group + lane].rest;
        hit = reaches_box(shape, rest, make_float2(box_low.x - shape.x, box_low.y - shape.y),
                          make_float2(box_high.x - shape.x, box_high.y - shape.y));
      }
      for (unsigned hits = __ballot_sync(~0u, hit); hits != 0; hits &= hits - 1) {
        const int j = group + __ffs(static_cast<int>(hits)) - 1;
        const float4 shape = staged[j].shape;
        const float4 rest = staged[j].rest;
        const float exponent =
            rest.y - math::whitened_square<float>({shape.z, shape.w, rest.x},
                                                  {centre.x - shape.x, centre.y - shape.y});
        const float before = pixel.transmittance;
        math::blend<float>(pixel, exponent, colour_of(rest));
        if (count_pairs) pairs += pixel.transmittance > 0.0f && pixel.transmittance != before;
      }
      warp_live = __any_sync(~0u, pixel.transmittance > 0.0f);
    }
  }
  if (count_pairs) atomicAdd(&p.counts->blended_pairs, pairs);
  if (!inside) return;
  const auto shown = math::resolve<float>(pixel, {p.background.x, p.background.y, p.background.z});
  float* out = p.rgb + 3 * (static_cast<std::size_t>(py) * p.shape.width_px + px);
  out[0] = shown.x;
  out[1] = shown.y;
  out[2] = shown.z;
}

}  // namespace

void launch_blend(const BlendParams& params, cudaStream_t stream) {
  const auto kernel = params.count_pairs ? blend_kernel<true> : blend_kernel<false>;
  kernel<<<params.shape.tiles(), block_size, 0, stream>>>(params);
  check_launch("blend");
}

}  // namespace catgs::cuda
