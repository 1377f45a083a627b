#include <cub/block/block_reduce.cuh>
#include <cub/block/block_scan.cuh>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/pixel.cuh"
#include "render_core/cuda/split.cuh"

namespace catgs::cuda {
namespace {

constexpr int split_block = 256;
constexpr std::uint32_t most_slices_per_tile = 1024;

/// How a tile is cut.
struct Cut {
  uint2 range;
  std::uint32_t reach;     // last frame's reach
  std::uint32_t expected;  // list entries that it is expected to look at
  std::uint32_t slices;    // of the expected entries; 0: the tile is not drawn
  std::uint32_t reserve;   // of the entries behind them

  __device__ std::uint32_t listed() const { return range.y - range.x; }
  /// Number of slices that need room: a whole tile needs none.
  __device__ std::uint32_t stored() const { return slices + reserve > 1 ? slices + reserve : 0; }
  __device__ Cut without_reserve() const { return {range, reach, expected, slices, 0}; }
  __device__ Cut whole() const { return {range, reach, listed(), 1, 0}; }
};

/// Whether a tile shows in the picture. The grid may be larger.
__device__ bool shows(const FrameShape& shape, int column, int row) {
  const int x = column * tile_side_px - shape.left_px, y = row * tile_side_px - shape.top_px;
  return x > -tile_side_px && y > -tile_side_px && x < shape.width_px && y < shape.height_px;
}

__device__ Cut cut_of(const SplitParams& p, std::uint32_t t) {
  const int column = static_cast<int>(t) % p.shape.tiles_x;
  const int row = static_cast<int>(t) / p.shape.tiles_x;
  const std::uint32_t known = p.last_reach.reach != nullptr ? p.last_reach.under(column, row) : ~0u;
  const Cut cut_nowhere{p.range[t], known, 0, 0, 0};
  if (!shows(p.shape, column, row)) return cut_nowhere;
  Cut cut = cut_nowhere.whole();
  if (!p.split) return cut;
  const std::uint32_t length = slice_length(
      p.mean_list > 0 ? p.mean_list
                      : min(p.counts->list_entries, p.shape.list_bound) / p.shape.tiles());
  const std::uint32_t reach = cut.reach;
  if (reach < cut.listed()) cut.expected = min(cut.listed(), reach + reach / 4 + 2 * warp_size);
  if (cut.expected > 2 * length)
    cut.slices = min((cut.expected + length - 1) / length, most_slices_per_tile);
  const std::uint32_t rest = cut.listed() - cut.expected;
  if (rest > 4 * length)
    cut.reserve = min((rest + 2 * length - 1) / (2 * length), most_slices_per_tile);
  return cut;
}

/// Places taken by the block's earlier threads, or by all of them.
struct Positions {
  std::uint32_t slices, slices_without_reserve;
};

struct AddPositions {
  __device__ Positions operator()(const Positions& a, const Positions& b) const {
    return {a.slices + b.slices, a.slices_without_reserve + b.slices_without_reserve};
  }
};

/// Finds room for `count` slices; false if there is none.
__device__ bool allocate(const SplitParams& p, std::uint32_t count, std::uint32_t& first) {
  std::uint32_t* allocated = &p.counts->allocated_slices;
  std::uint32_t seen = *const_cast<const volatile std::uint32_t*>(allocated);
  while (count <= p.shape.slice_bound - seen) {
    first = seen;
    seen = atomicCAS(allocated, seen, seen + count);
    if (seen == first) return true;
  }
  return false;
}

/// Number of a tile's slices in one class of the queue.
__device__ std::uint32_t queued_in(int queue_class, const Cut& cut) {
  const std::uint32_t c = static_cast<std::uint32_t>(queue_class);
  if (queue_class + 1 < queue_classes) return c < cut.slices ? 1 : 0;
  return cut.reserve + (cut.slices > c ? cut.slices - c : 0);
}

/// `first`: the tile's first slice, if any; `position`: its first place in each class of the queue.
__device__ void write_tasks(const SplitParams& p, std::uint32_t t, const Cut& cut,
                            std::uint32_t first, const std::uint32_t (&position)[queue_classes]) {
  const std::uint32_t slices = cut.slices + cut.reserve;
  const std::uint32_t rest = cut.listed() - cut.expected;
  const std::uint32_t first_task = slices > 1 ? p.shape.tiles() + first : t;
  const auto begin_of = [&](std::uint32_t s) {
    const bool expected = s < cut.slices || cut.reserve == 0;
    const std::uint64_t length = expected ? cut.expected : rest;
    const std::uint32_t k = expected ? s : s - cut.slices;
    const std::uint32_t of = expected ? cut.slices : cut.reserve;
    return cut.range.x + (expected ? 0 : cut.expected) +
           static_cast<std::uint32_t>(length * k / of);
  };
  for (std::uint32_t s = 0; s < slices; ++s) {
    p.tasks[first_task + s] = {t, begin_of(s), s + 1 == slices ? cut.range.y : begin_of(s + 1),
                               static_cast<std::uint16_t>(s), static_cast<std::uint16_t>(slices)};
    for (int part = 0; part < parts_per_tile && slices > 1; ++part)
      p.slice_transmittance[slice_part(first + s, part)] = 1.0f;
    const bool in_last = s >= cut.slices || s + 1 >= queue_classes;
    const std::uint32_t c = in_last ? queue_classes - 1 : s;
    const std::uint32_t earlier = in_last ? s - min(cut.slices, queue_classes - 1u) : 0;
    p.queue[c * p.shape.tiles() + position[c] + earlier] = first_task + s;
  }
}

/// Finds room for slices of the block's tiles: for all, for those that will be looked at, or for
/// none. `cut` becomes what is left for this thread's tile. Returns its first slice.
__device__ std::uint32_t make_room(const SplitParams& p, Cut& cut, const Positions& before,
                                   const Positions& all) {
  enum class Room { all, without_reserve, none };
  __shared__ Room room;
  __shared__ std::uint32_t first_in_block;
  if (threadIdx.x == 0) {
    atomicAdd(&p.counts->wanted_slices, all.slices);
    room = allocate(p, all.slices, first_in_block)                   ? Room::all
           : allocate(p, all.slices_without_reserve, first_in_block) ? Room::without_reserve
                                                                     : Room::none;
  }
  __syncthreads();
  if (room == Room::all) return first_in_block + before.slices;
  cut = room == Room::none ? cut.whole() : cut.without_reserve();
  return first_in_block + before.slices_without_reserve;
}

__global__ void __launch_bounds__(split_block) split_kernel(const SplitParams p) {
  using Scan = cub::BlockScan<Positions, split_block>;
  __shared__ Scan::TempStorage scratch;
  __shared__ std::uint32_t queued[queue_classes];  // by the block; then before the block
  const std::uint32_t tiles = p.shape.tiles();
  const std::uint32_t t = blockIdx.x * split_block + threadIdx.x;
  const bool present = t < tiles;
  Cut cut = present ? cut_of(p, t) : Cut{};
  Positions before{}, all{};
  Scan(scratch).ExclusiveScan({cut.stored(), cut.without_reserve().stored()}, before, Positions{},
                              AddPositions{}, all);
  if (threadIdx.x < queue_classes) queued[threadIdx.x] = 0;
  const unsigned long long expected = __reduce_add_sync(~0u, cut.expected);
  const std::uint32_t longest = __reduce_max_sync(~0u, cut.listed());
  if (threadIdx.x % warp_size == 0) {
    atomicAdd(&p.counts->expected_entries, expected);
    atomicMax(&p.counts->list_max, longest);
  }
  __syncthreads();
  const bool drawn = cut.slices > 0;
  const std::uint32_t first = make_room(p, cut, before, all);
  std::uint32_t position[queue_classes];
#pragma unroll
  for (int c = 0; c < queue_classes; ++c) {
    const std::uint32_t n = present ? queued_in(c, cut) : 0;
    position[c] = n > 0 ? atomicAdd(&queued[c], n) : 0;
  }
  __syncthreads();
  if (threadIdx.x < queue_classes)
    queued[threadIdx.x] = atomicAdd(&p.counts->queued[threadIdx.x], queued[threadIdx.x]);
  __syncthreads();
  if (!present) return;
#pragma unroll
  for (int c = 0; c < queue_classes; ++c) position[c] += queued[c];
  p.reach[t] = drawn ? 0 : ~0u;
  p.tile_slices[t] = make_uint2(first, cut.stored());
  write_tasks(p, t, cut, first, position);
}

constexpr int composite_block = 256;
constexpr int parts_per_block = composite_block / part_pixels;
static_assert(composite_block % part_pixels == 0 && part_pixels == 2 * warp_size);

/// A pixel looked at entries up to this one.
struct Look {
  std::uint32_t end;  // one past its last list entry
  bool finished;
};

/// Blends the slices of pixel `in_tile` and writes it.
__device__ Look fold(const CompositeParams& p, std::uint32_t tile, uint2 slices, int in_tile) {
  const int part = in_tile / part_pixels, in_part = in_tile % part_pixels;
  const int2 corner = part_corner_px(p.shape, tile, part);
  const int x_px = corner.x + in_part % part_side_px, y_px = corner.y + in_part / part_side_px;
  if (!in_picture(p.shape, x_px, y_px)) return {0, true};
  math::PixelState<float> pixel = math::empty_pixel<float>();
  Look look{0, false};
  for (std::uint32_t s = slices.x; s < slices.x + slices.y && !look.finished; ++s) {
    const float4 slice = p.slice_pixels[slice_pixel(s, in_tile)];
    pixel.colour.x += pixel.transmittance * slice.x;
    pixel.colour.y += pixel.transmittance * slice.y;
    pixel.colour.z += pixel.transmittance * slice.z;
    pixel.transmittance *= fabsf(slice.w);
    look.end = p.consumed[slice_part(s, part)];
    look.finished = signbit(slice.w) || pixel.transmittance < p.finish.transmittance;
  }
  show_pixel(p.rgb, p.shape, x_px, y_px, pixel, p.background, p.finish);
  return look;
}

/// A block takes the tiles in turn, some parts at a time.
__global__ void __launch_bounds__(composite_block) composite_kernel(const CompositeParams p) {
  const std::uint32_t tile = blockIdx.x / (parts_per_tile / parts_per_block);
  const uint2 slices = p.tile_slices[tile];
  if (slices.y == 0) return;
  const int thread = static_cast<int>(threadIdx.x);
  const int first_part =
      static_cast<int>(blockIdx.x % (parts_per_tile / parts_per_block)) * parts_per_block;
  const Look look = fold(p, tile, slices, first_part * part_pixels + thread);
  __shared__ std::uint32_t ends[composite_block / warp_size];
  __shared__ bool finished[composite_block / warp_size];
  const std::uint32_t end = __reduce_max_sync(~0u, look.end);
  const bool all_finished = __all_sync(~0u, look.finished);
  if (thread % warp_size == 0) {
    ends[thread / warp_size] = end;
    finished[thread / warp_size] = all_finished;
  }
  __syncthreads();
  if (thread >= parts_per_block) return;
  const std::uint32_t part_end = max(ends[2 * thread], ends[2 * thread + 1]);
  const bool part_finished = finished[2 * thread] && finished[2 * thread + 1];
  const std::uint32_t first = p.tasks[p.shape.tiles() + slices.x].first;
  if (part_end > first) atomicMax(&p.reach[tile], part_end - first);
  // A part beyond the picture's edge counts as finished, and has looked at nothing.
  if (part_finished && part_end == 0) return;
  if (p.ends.depth == nullptr) return;
  float depth = INFINITY;
  if (part_finished) {
    const std::uint32_t entries = p.loose ? min(loose_end_entries, part_end - first) : 1;
    depth = 0.0f;
    for (std::uint32_t back = 1; back <= entries; ++back)
      depth = fmaxf(depth, p.ends.splat_depth[p.entries[part_end - back].slot]);
  }
  p.ends.note(tile, first_part + thread, depth);
}

}  // namespace

void launch_split(const SplitParams& params, cudaStream_t stream) {
  split_kernel<<<blocks_for(params.shape.tiles(), split_block), split_block, 0, stream>>>(params);
  check_launch("split");
}

void launch_composite(const CompositeParams& params, cudaStream_t stream) {
  const std::uint32_t blocks = params.shape.tiles() * (parts_per_tile / parts_per_block);
  composite_kernel<<<blocks, composite_block, 0, stream>>>(params);
  check_launch("composite");
}

}  // namespace catgs::cuda
