#include <algorithm>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/gaussian.cuh"
#include "render_core/cuda/pixel.cuh"
#include "render_core/cuda/shade.cuh"
#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/vanilla.cuh"

namespace catgs::cuda {
namespace {

/// Gaussians in scene order; slot = scene index.
struct ProjectParams {
  SceneArrays scene;
  CameraPair camera;
  FrameShape shape;
  SplatRecord* records;       // [count]
  float* depth;               // [count]
  ushort4* box;               // [count]
  std::uint32_t* tile_count;  // [count]
  FrameCounts* counts;        // visible is counted
};

struct EmitParams {
  std::uint32_t count;
  FrameShape shape;
  const std::uint32_t* last;  // [count]
  const float* depth;
  const ushort4* box;
  std::uint64_t* key;   // by list entry
  std::uint32_t* slot;  // likewise
  FrameCounts* counts;  // list_entries is set
};

struct BlendParams {
  FrameShape shape;
  const SplatRecord* records;
  const std::uint64_t* key;   // by list entry, sorted
  const std::uint32_t* slot;  // likewise
  uint2* range;               // [tiles]
  float3 background;
  float* rgb;
  FrameCounts* counts;  // list_max; blended_pairs when counted
  bool count_pairs;
};

constexpr int block_size = 256;

/// The tiles that a box of whole pixels around the centre overlaps, rounded as in the original.
__device__ ushort4 box_of(float2 centre_px, float radius, const FrameShape& shape) {
  constexpr float side = tile_size_px;
  const float x = centre_px.x - 0.5f, y = centre_px.y - 0.5f;
  const auto tile = [](float at, int tiles) {
    return static_cast<unsigned short>(
        math::clamp(floorf(at / side), 0.0f, static_cast<float>(tiles)));
  };
  return make_ushort4(tile(x - radius, shape.tiles_x), tile(y - radius, shape.tiles_y),
                      tile(x + radius + side - 1.0f, shape.tiles_x),
                      tile(y + radius + side - 1.0f, shape.tiles_y));
}

__global__ void __launch_bounds__(block_size) project_kernel(const ProjectParams p) {
  const std::uint32_t i = blockIdx.x * block_size + threadIdx.x;
  if (i >= p.scene.count) return;
  p.tile_count[i] = 0;
  auto [mean, log2_opacity] = load_centre(p.scene, i);
  const math::CameraModel<float>& camera = p.camera.single;
  const float depth =
      static_cast<float>(math::view_depth(p.camera.precise, math::convert<double>(mean)));
  if (!(depth > camera.near_z) || math::reach_of(log2_opacity) < 0.0f) return;
  if (!math::is_kept(camera, mean)) return;
  const auto g = math::project<float>(camera, mean, load_factor(p.scene, i), depth);
  if (p.scene.antialiased) log2_opacity = math::antialiased_log2_opacity(log2_opacity, g);
  if (math::reach_of(log2_opacity) < 0.0f) return;
  const float2 centre = make_float2(g.centre_px.x, g.centre_px.y);
  const ushort4 box = box_of(centre, math::three_sigma_radius(g), p.shape);
  const std::uint32_t tiles = static_cast<std::uint32_t>(box.z - box.x) * (box.w - box.y);
  if (tiles == 0) return;
  const auto colour =
      shade(load_sh(p.scene, i), p.scene.sh_degree, math::view_direction<float>(camera.eye, mean));
  p.records[i] = {centre, math::whitening(g), log2_opacity, pack(colour, 0.0f)};
  p.depth[i] = depth;
  p.box[i] = box;
  p.tile_count[i] = tiles;
  atomicAdd(&p.counts->visible, 1u);
}

__global__ void __launch_bounds__(block_size) emit_kernel(const EmitParams p) {
  const std::uint32_t i = blockIdx.x * block_size + threadIdx.x;
  if (i >= p.count) return;
  if (i + 1 == p.count) p.counts->list_entries = p.last[i];
  std::uint32_t at = i == 0 ? 0 : p.last[i - 1];
  if (at == p.last[i]) return;
  const ushort4 box = p.box[i];
  const std::uint32_t depth = __float_as_uint(p.depth[i]);
  for (std::uint32_t y = box.y; y < box.w; ++y) {
    for (std::uint32_t x = box.x; x < box.z; ++x, ++at) {
      if (at >= p.shape.list_bound) return;
      p.key[at] = std::uint64_t{y * p.shape.tiles_x + x} << 32 | depth;
      p.slot[at] = i;
    }
  }
}

__global__ void __launch_bounds__(block_size) ranges_kernel(const BlendParams p) {
  const std::uint32_t i = blockIdx.x * block_size + threadIdx.x;
  const std::uint32_t entries = min(p.counts->list_entries, p.shape.list_bound);
  if (i >= entries) return;
  const std::uint32_t tile = static_cast<std::uint32_t>(p.key[i] >> 32);
  if (i == 0 || static_cast<std::uint32_t>(p.key[i - 1] >> 32) != tile) p.range[tile].x = i;
  if (i + 1 == entries || static_cast<std::uint32_t>(p.key[i + 1] >> 32) != tile)
    p.range[tile].y = i + 1;
}

__global__ void __launch_bounds__(block_size) blend_kernel(const BlendParams p) {
  static_assert(block_size == tile_size_px * tile_size_px);
  __shared__ SplatRecord staged[block_size];
  const int tile = static_cast<int>(blockIdx.x), thread = static_cast<int>(threadIdx.x);
  const int px = tile % p.shape.tiles_x * tile_size_px + thread % tile_size_px;
  const int py = tile / p.shape.tiles_x * tile_size_px + thread / tile_size_px;
  const bool inside = px < p.shape.width_px && py < p.shape.height_px;
  const float2 centre = make_float2(static_cast<float>(px) + 0.5f, static_cast<float>(py) + 0.5f);
  const uint2 range = p.range[tile];
  if (thread == 0) atomicMax(&p.counts->list_max, range.y - range.x);
  auto pixel = math::empty_pixel<float>();
  if (!inside) pixel.transmittance = -0.0f;
  unsigned long long pairs = 0;
  for (std::uint32_t first = range.x; first < range.y; first += block_size) {
    if (__syncthreads_count(pixel.transmittance > 0.0f) == 0) break;
    const std::uint32_t at = first + static_cast<std::uint32_t>(thread);
    if (at < range.y) staged[thread] = p.records[p.slot[at]];
    __syncthreads();
    const int count = static_cast<int>(min(range.y - first, std::uint32_t{block_size}));
    for (int j = 0; j < count && pixel.transmittance > 0.0f; ++j) {
      const SplatRecord& s = staged[j];
      const float exponent =
          s.log2_opacity - math::whitened_square<float>(
                               s.whitening, {centre.x - s.centre_px.x, centre.y - s.centre_px.y});
      if (!math::contributes(exponent)) continue;
      const float2 red_green = __half22float2(s.colour.red_green);
      const bool live = math::blend<float>(pixel, exponent,
                                           {red_green.x, red_green.y, __half2float(s.colour.blue)});
      if (p.count_pairs && live) ++pairs;
    }
  }
  if (p.count_pairs) atomicAdd(&p.counts->blended_pairs, pairs);
  show_pixel(p.rgb, p.shape, px, py, pixel, p.background, {.transmittance = 0.0f, .fills = false});
}

}  // namespace

void VanillaPipeline::project(const Frame& f, cudaStream_t stream) {
  const VanillaMemory& m = memory_;
  const std::uint32_t count = f.scene->count;
  const std::uint32_t blocks = std::max(blocks_for(count, block_size), 1u);  // none in empty scenes
  project_kernel<<<blocks, block_size, 0, stream>>>({.scene = *f.scene,
                                                     .camera = f.camera,
                                                     .shape = f.shape,
                                                     .records = m.records.get(),
                                                     .depth = m.depth.get(),
                                                     .box = m.box.get(),
                                                     .tile_count = m.tile_count.get(),
                                                     .counts = f.counts});
  check_launch("vanilla project");
}

/// Number of list entries of the projected Gaussians, limited to the room that there is.
std::uint32_t VanillaPipeline::count_entries(const Frame& f, cudaStream_t stream) {
  const VanillaMemory& m = memory_;
  const std::uint32_t count = f.scene->count;
  *m.entries.get() = 0;
  if (count > 0) {
    sum_tile_counts(count, m.tile_count.get(), m.last.get(),
                    {.memory = m.scratch.get(), .bytes = m.scratch.bytes()}, stream);
    check(cudaMemcpyAsync(m.entries.get(), m.last.get() + (count - 1), sizeof(std::uint32_t),
                          cudaMemcpyDeviceToHost, stream),
          "list entries");
    check(cudaStreamSynchronize(stream), "vanilla project");
  }
  return std::min(*m.entries.get(), f.shape.list_bound);
}

void VanillaPipeline::draw(const Frame& f, const std::function<void(Stage)>& mark,
                           cudaStream_t stream) {
  const VanillaMemory& m = memory_;
  const std::uint32_t count = f.scene->count;
  (void)memory_.reserve({.gaussians = count, .entries = 0, .shape = f.shape});
  project(f, stream);
  mark(Stage::project);

  const std::uint32_t entries = count_entries(f, stream);
  // The device has finished, so rows that grow are not in use.
  (void)memory_.reserve({.gaussians = count, .entries = entries, .shape = f.shape});
  emit_kernel<<<std::max(blocks_for(count, block_size), 1u), block_size, 0, stream>>>(
      {.count = count,
       .shape = f.shape,
       .last = m.last.get(),
       .depth = m.depth.get(),
       .box = m.box.get(),
       .key = m.key.get(),
       .slot = m.slot.get(),
       .counts = f.counts});
  check_launch("vanilla emit");
  mark(Stage::bin);

  PingPong<std::uint64_t> key{.current = m.key.get(), .other = m.other_key.get()};
  PingPong<std::uint32_t> slot{.current = m.slot.get(), .other = m.other_slot.get()};
  sort_by_key(entries, f.shape, key, slot, {.memory = m.scratch.get(), .bytes = m.scratch.bytes()},
              stream);
  const BlendParams blend{.shape = f.shape,
                          .records = m.records.get(),
                          .key = key.current,
                          .slot = slot.current,
                          .range = m.range.get(),
                          .background = f.background,
                          .rgb = f.rgb,
                          .counts = f.counts,
                          .count_pairs = f.count_pairs};
  check(cudaMemsetAsync(m.range.get(), 0, f.shape.tiles() * sizeof(uint2), stream), "ranges");
  ranges_kernel<<<std::max(blocks_for(entries, block_size), 1u), block_size, 0, stream>>>(blend);
  check_launch("vanilla ranges");
  mark(Stage::sort);

  blend_kernel<<<f.shape.tiles(), block_size, 0, stream>>>(blend);
  check_launch("vanilla blend");
  mark(Stage::blend);
}

}  // namespace catgs::cuda
