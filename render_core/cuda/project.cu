#include "render_core/cuda/early_launch.cuh"
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

/// Whether a Gaussian has no colour from an earlier frame.
__device__ bool wants_shading(const ColourArrays& colours, std::uint32_t i) {
  return colours.wanted == nullptr || (colours.wanted[i / warp_size] >> i % warp_size & 1u) != 0;
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

/// Adds a Gaussian to the group's set if it is a giant.
__device__ void note_giant(const ProjectParams& p, std::uint32_t v, const Splat& splat) {
  const bool is_giant = p.giants.bits != nullptr && splat.in_view &&
                        p.giants.is_giant(splat.centre_px, splat.half_px);
  if (!is_giant) return;
  const std::uint32_t bit = giant_bit(v);
  if ((atomicOr(&p.giants.bits[giant_word(v)], bit) & bit) == 0) atomicAdd(&p.counts->giants, 1u);
}

template <Listing listing>
__global__ void __launch_bounds__(block_size) project_kernel(const ProjectParams p) {
  const std::uint32_t v = blockIdx.x * block_size + threadIdx.x;
  wait_for_earlier_work();
  if (v >= min(p.counts->visible, p.shape.visible_bound)) return;
  if constexpr (listing != Listing::none) p.order[v] = v;
  const std::uint32_t i = p.visible[v] & ~watched_bit;
  const Centre centre = load_centre(p.scene, i);
  const bool shades = wants_shading(p.colours, i);
  ShCoefficients sh{};
  PackedColour colour{};
  if (shades) {
    sh = load_sh(p.scene, i);
  } else {
    colour = p.colours.colour[i];
  }
  const Splat splat = make_splat<listing == Listing::trails>(p.scene, p.camera, p.shape, i, centre);
  const math::CameraModel<float>& now = p.camera.now.single;
  if (shades) {
    colour =
        pack(shade(sh, p.scene.sh_degree, math::view_direction<float>(now.position, centre.mean)));
    if (p.colours.colour != nullptr) p.colours.colour[i] = colour;
  }
  p.records[v] = {splat.centre_px, splat.whitening, splat.log2_opacity, colour};
  p.depth_key[v] = depth_key(splat.depth, p.camera.near_z);
  const bool listed = listing == Listing::none || splat.in_view;
  const bool counted = listed && splat.depth > fmaxf(p.min_depth, p.camera.near_z);
  raise(&p.counts->nearness, counted ? ~__float_as_uint(splat.depth) : 0u);
  if (blockIdx.x % sampled_blocks == 0) add_inverse_depth(p, counted, splat.depth);
  if constexpr (listing == Listing::none) note_giant(p, v, splat);
  if (listing == Listing::none && splat.in_view && (p.visible[v] & watched_bit) != 0)
    p.counts->unlisted = 1;
  if constexpr (listing != Listing::none) {
    if (splat.watched) p.visible[v] = i | watched_bit;
    TileSpans spans{};
    std::uint32_t tiles = 0;
    if constexpr (listing == Listing::trails) {
      const float displacement = hypotf(splat.path.dx, splat.path.dy);
      raise(&p.counts->displacement, counted ? __float_as_uint(displacement) : 0u);
      p.path[v] = splat.path;
      if (splat.in_view)
        tiles = find_tiles(make_footprint(splat.centre_px, splat.path, p.shape), spans);
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
  launch_early("project", kernel, blocks, block_size, stream, params);
}

}  // namespace catgs::cuda
