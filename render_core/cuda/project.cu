#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/project.cuh"
#include "render_core/cuda/shade.cuh"
#include "render_core/cuda/sort.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 128;

/// Raises *target to `value`. The value only grows, so most threads see that theirs is no maximum.
__device__ void raise(std::uint32_t* target, std::uint32_t value) {
  const std::uint32_t largest = __reduce_max_sync(__activemask(), value);
  if (value == largest && largest > *const_cast<const volatile std::uint32_t*>(target))
    atomicMax(target, largest);
}

// The mean depth is taken from a sample of the blocks. That is enough, and their sums meet in one
// place.
constexpr unsigned sampled_blocks = 16;

__device__ void add_inverse_depth(const ProjectParams& p, bool counted, float depth) {
  const unsigned lanes = __activemask();
  const auto share =
      counted ? static_cast<unsigned>(inverse_depth_scale * p.camera.near_z / depth) : 0u;
  const unsigned sum = __reduce_add_sync(lanes, share);
  const unsigned count = __reduce_add_sync(lanes, counted ? 1u : 0u);
  if (static_cast<int>(threadIdx.x % warp_size) != __ffs(static_cast<int>(lanes)) - 1) return;
  atomicAdd(&p.counts->inverse_depths, static_cast<unsigned long long>(sum));
  atomicAdd(&p.counts->sampled, count);
}

/// Counts a splat of a sub-frame that is drawn too far from its listed path.
__device__ void count_stray(const ProjectParams& p, const Splat& splat, const SplatPath& path) {
  const float x = splat.centre_px.x - path.x, y = splat.centre_px.y - path.y;
  const float length2 = path.dx * path.dx + path.dy * path.dy;
  const float share = length2 > 0.0f ? __saturatef((x * path.dx + y * path.dy) / length2) : 0.0f;
  const float beyond = hypotf(x - share * path.dx, y - share * path.dy);
  const bool strays =
      splat.in_view && splat.log2_opacity > never && beyond > p.slack.at(splat.depth) + stray_px;
  const unsigned lanes = __activemask();
  const unsigned count = __reduce_add_sync(lanes, strays ? 1u : 0u);
  if (count == 0 || static_cast<int>(threadIdx.x % warp_size) != __ffs(static_cast<int>(lanes)) - 1)
    return;
  const std::uint32_t before = atomicAdd(&p.counts->strays, count);
  if (before <= most_strays && before + count > most_strays) p.host_counts->strays = before + count;
}

template <Listing listing>
__global__ void __launch_bounds__(block_size) project_kernel(const ProjectParams p) {
  const std::uint32_t v = blockIdx.x * block_size + threadIdx.x;
  if (v >= min(p.counts->visible, p.shape.visible_bound)) return;
  if constexpr (listing != Listing::none) p.order[v] = v;
  const std::uint32_t i = p.visible[v];
  const Centre centre = load_centre(p.scene, i);
  const ShCoefficients sh = load_sh(p.scene, i);
  const Splat splat = make_splat<listing == Listing::trails>(p.scene, p.camera, p.shape, i, centre);
  const math::CameraModel<float>& now = p.camera.now.single;
  const PackedColour colour =
      pack(shade(sh, p.scene.sh_degree, math::view_direction<float>(now.eye, centre.mean)),
           splat.half_side_px);
  p.records[v] = {splat.centre_px, splat.whitening, splat.log2_opacity, colour};
  p.depth_key[v] = depth_key(splat.depth, p.camera.near_z);
  if (p.splat_depth != nullptr) p.splat_depth[v] = splat.depth;
  const bool listed = listing == Listing::none || splat.in_view;
  const bool counted = listed && splat.depth > fmaxf(p.min_depth, p.camera.near_z);
  raise(&p.counts->nearness, counted ? ~__float_as_uint(splat.depth) : 0u);
  if (blockIdx.x % sampled_blocks == 0) add_inverse_depth(p, counted, splat.depth);
  if constexpr (listing == Listing::none) {
    if (p.path != nullptr) count_stray(p, splat, p.path[v]);
  }
  if constexpr (listing != Listing::none) {
    TileSpans spans{};
    std::uint32_t tiles = 0;
    if constexpr (listing == Listing::trails) {
      const float displacement = hypotf(splat.path.dx, splat.path.dy);
      raise(&p.counts->displacement, counted ? __float_as_uint(displacement) : 0u);
      p.path[v] = splat.path;
      if (splat.in_view)
        tiles = with_footprint(splat.path, p.shape, least_slack_px + p.slack.at(splat.depth),
                               [&](const auto& footprint) { return find_tiles(footprint, spans); });
    } else if (splat.in_view) {  // culling may have rounded differently
      tiles = find_tiles(
          make_footprint(splat.centre_px, splat.whitening, splat.log2_opacity, p.shape), spans);
    }
    p.tile_count[v] = tiles;
    p.spans[v] = spans;
  }
}

}  // namespace

void launch_project(const ProjectParams& params, Listing listing, cudaStream_t stream) {
  const std::uint32_t blocks = blocks_for(params.shape.visible_bound, block_size);
  const auto kernel = listing == Listing::none       ? project_kernel<Listing::none>
                      : listing == Listing::ellipses ? project_kernel<Listing::ellipses>
                                                     : project_kernel<Listing::trails>;
  kernel<<<blocks, block_size, 0, stream>>>(params);
  check_launch("project");
}

}  // namespace catgs::cuda
