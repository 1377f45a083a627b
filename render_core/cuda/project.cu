#include "render_core/cuda/project.cuh"
#include "render_core/cuda/tiles.cuh"
#include "render_core/math/projection-inl.h"
#include "render_core/math/spherical_harmonics-inl.h"

namespace catgs::cuda {
namespace {

constexpr int block_size = 256;
constexpr int warps = block_size / warp_size;

// Words of the look-back: what is known of a block's visible count, in the upper half.
constexpr std::uint64_t has_count = std::uint64_t{1} << 32;
constexpr std::uint64_t has_prefix = std::uint64_t{2} << 32;

__device__ std::uint64_t load_word(const std::uint64_t* p) {
  return *const_cast<const volatile std::uint64_t*>(p);
}
__device__ void store_word(std::uint64_t* p, std::uint64_t value) {
  *const_cast<volatile std::uint64_t*>(p) = value;
}

/// Visible Gaussians in all earlier blocks, by one warp: single-pass scan with decoupled look-back
/// (Merrill and Garland 2016). Value and state travel in one 64-bit word, so no fence is needed.
__device__ std::uint32_t look_back(std::uint64_t* state, int block, std::uint32_t count) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  if (lane == 0) store_word(&state[block], (block == 0 ? has_prefix : has_count) | count);
  std::uint32_t before = 0;
  for (int nearest = block - 1; nearest >= 0; nearest -= warp_size) {
    const int at = nearest - lane;
    std::uint64_t word;
    do {
      word = at >= 0 ? load_word(&state[at]) : has_prefix;
    } while (__any_sync(~0u, (word >> 32) == 0));
    const unsigned known = __ballot_sync(~0u, (word & has_prefix) != 0);
    const int last = known ? __ffs(static_cast<int>(known)) - 1 : warp_size - 1;
    before += __reduce_add_sync(~0u, lane <= last ? static_cast<std::uint32_t>(word) : 0u);
    if (known) break;
  }
  if (lane == 0 && block > 0) store_word(&state[block], has_prefix | (before + count));
  return before;
}

struct Projected {
  float2 centre_px;
  math::Whitening<float> whitening;
  float log2_opacity;
  float depth;
  std::uint32_t tiles = 0;  // 0: culled
};

__device__ Projected project_one(const ProjectParams& p, std::uint32_t i, const float4& mean) {
  Projected out;
  const math::Vec3<double> mean_double{mean.x, mean.y, mean.z};
  out.depth = static_cast<float>(math::view_depth(p.camera_double, mean_double));
  out.log2_opacity = mean.w;
  if (!(out.depth > p.camera.near_z) || math::reach_of(mean.w) < 0.0f) return out;

  const float4 a = __ldg(&p.scene.factor_a[i]);
  const float2 b = __ldg(&p.scene.factor_b[i]);
  const auto g = math::project<float>(p.camera, {mean.x, mean.y, mean.z},
                                      {a.x, a.y, a.z, a.w, b.x, b.y}, out.depth);
  const auto half = math::half_extent(g, math::reach_of(mean.w));
  if (g.centre_px.x + half.x < 0.0f || g.centre_px.y + half.y < 0.0f ||
      g.centre_px.x - half.x > static_cast<float>(p.shape.width_px) ||
      g.centre_px.y - half.y > static_cast<float>(p.shape.height_px)) {
    return out;
  }
  out.centre_px = make_float2(g.centre_px.x, g.centre_px.y);
  out.whitening = math::whitening(g);
  const TileFootprint f = make_footprint(out.centre_px, out.whitening, out.log2_opacity, p.shape);
  for (int row = f.first_row; row <= f.last_row; ++row) {
    const int2 columns = f.columns(row);
    out.tiles += static_cast<std::uint32_t>(max(0, columns.y - columns.x + 1));
  }
  return out;
}

__device__ math::Vec3<float> shade(const ProjectParams& p, std::uint32_t i, const float4& mean) {
  float basis[16] = {};  // all set: padding multiplies what the degree leaves out
  math::sh_basis(math::view_direction<float>(p.camera.position, {mean.x, mean.y, mean.z}),
                 p.scene.sh_degree, basis);
  const float4* sh = p.scene.sh + static_cast<std::size_t>(i) * p.scene.sh_stride;
  float sum[4] = {0.0f, 0.0f, 0.0f, 0.0f};  // the fourth takes the padding of degrees 0 and 2
#pragma unroll
  for (int q = 0; q < 12; ++q) {
    if (q >= p.scene.sh_stride) break;
    const float4 v = __ldg(&sh[q]);
    const float part[4] = {v.x, v.y, v.z, v.w};
#pragma unroll
    for (int j = 0; j < 4; ++j) {
      const int at = 4 * q + j;
      sum[at % 3] += basis[at / 3] * part[j];
    }
  }
  return {math::colour_from_sh_sum(sum[0]), math::colour_from_sh_sum(sum[1]),
          math::colour_from_sh_sum(sum[2])};
}

__global__ void __launch_bounds__(block_size) project_kernel(const ProjectParams p) {
  __shared__ int shared_block;
  __shared__ std::uint32_t warp_count[warps];
  __shared__ std::uint32_t shared_before;
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const int warp = static_cast<int>(threadIdx.x) / warp_size;

  // Blocks take their place when they start: the look-back never waits for one that has not.
  if (threadIdx.x == 0) {
    shared_block =
        static_cast<int>(atomicAdd(reinterpret_cast<unsigned long long*>(p.block_state), 1ull));
  }
  __syncthreads();
  const int block = shared_block;
  const std::uint32_t i = static_cast<std::uint32_t>(block) * block_size + threadIdx.x;

  float4 mean = make_float4(0.0f, 0.0f, 0.0f, 0.0f);
  Projected g;
  if (i < p.scene.count) {
    mean = __ldg(&p.scene.mean_opacity[i]);
    g = project_one(p, i, mean);
  }
  const bool visible = g.tiles > 0;
  const unsigned visible_lanes = __ballot_sync(~0u, visible);
  if (lane == 0) warp_count[warp] = static_cast<std::uint32_t>(__popc(visible_lanes));
  __syncthreads();
  std::uint32_t in_block = 0, in_earlier_warps = 0;
#pragma unroll
  for (int w = 0; w < warps; ++w) {
    if (w < warp) in_earlier_warps += warp_count[w];
    in_block += warp_count[w];
  }
  if (warp == 0) {
    const std::uint32_t before = look_back(p.block_state + 1, block, in_block);
    if (lane == 0) {
      shared_before = before;
      if (block == static_cast<int>(gridDim.x) - 1) p.counts->visible = before + in_block;
    }
  }
  __syncthreads();
  if (!visible) return;
  const unsigned earlier_lanes = visible_lanes & ((1u << lane) - 1u);
  const std::uint32_t slot =
      shared_before + in_earlier_warps + static_cast<std::uint32_t>(__popc(earlier_lanes));
  if (slot >= p.shape.visible_bound) return;

  const math::Vec3<float> colour = shade(p, i, mean);
  p.records[slot] = {g.centre_px,
                     g.whitening,
                     g.log2_opacity,
                     __floats2half2_rn(colour.x, colour.y),
                     __float2half_rn(colour.z),
                     __float2half_rn(0.0f)};
  p.depth_key[slot] = __float_as_uint(g.depth);  // depths are positive: bits sort like values
  p.tile_count[slot] = g.tiles;
}

}  // namespace

std::uint32_t project_blocks(std::uint32_t count) { return (count + block_size - 1) / block_size; }

void launch_project(const ProjectParams& params, cudaStream_t stream) {
  if (params.scene.count == 0) return;
  project_kernel<<<project_blocks(params.scene.count), block_size, 0, stream>>>(params);
  check_launch("project");
}

}  // namespace catgs::cuda
