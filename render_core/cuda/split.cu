#include <cub/block/block_reduce.cuh>
#include <cub/block/block_scan.cuh>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/early_launch.cuh"
#include "render_core/cuda/pixel.cuh"
#include "render_core/cuda/split.cuh"

namespace catgs::cuda {
namespace {

constexpr int split_block = 256;
constexpr std::uint32_t most_slices_per_tile = 1024;

/// How a tile is cut.
struct Cut {
  uint2 range;
  bool seen;               // it has pixels in the picture
  std::uint32_t reach;     // last frame's reach
  std::uint32_t expected;  // list entries that it is expected to look at
  std::uint32_t slices;    // of the expected entries
  std::uint32_t reserve;   // of the entries behind them

  __device__ std::uint32_t listed() const { return range.y - range.x; }
  /// Number of slices that need room: a whole tile needs none.
  __device__ std::uint32_t stored() const { return slices + reserve > 1 ? slices + reserve : 0; }
  __device__ Cut without_reserve() const { return {range, seen, reach, expected, slices, 0}; }
  __device__ Cut whole() const {
    return {range, seen, reach, seen ? listed() : 0, seen ? 1u : 0u, 0};
  }
};

/// The reach in the last frame of this tile, or of the one that showed its middle; all ones:
/// unknown.
__device__ std::uint32_t last_reach(const SplitParams& p, std::uint32_t t) {
  const LastReach& last = p.last;
  if (last.reach == nullptr) return ~0u;
  if (last.same_grid) return last.reach[t];
  constexpr float middle = 0.5f * tile_size_px;
  const int x = static_cast<int>(t) % p.shape.tiles_x, y = static_cast<int>(t) / p.shape.tiles_x;
  const auto at = math::apply<float>(
      last.list_from_frame, {static_cast<float>(p.shape.shown_x_px + x * tile_size_px) + middle,
                             static_cast<float>(p.shape.shown_y_px + y * tile_size_px) + middle});
  constexpr float tile = tile_size_px;
  const int last_x = static_cast<int>((at.x - static_cast<float>(last.first_x_px)) / tile);
  const int last_y = static_cast<int>((at.y - static_cast<float>(last.first_y_px)) / tile);
  // A turn shows places that the last frame did not list.
  const bool listed = at.x >= static_cast<float>(last.first_x_px) && last_x < last.tiles_x &&
                      at.y >= static_cast<float>(last.first_y_px) && last_y < last.tiles_y;
  return listed ? last.reach[last_y * last.tiles_x + last_x] : ~0u;
}

__device__ bool is_seen(const SplitParams& p, std::uint32_t t) {
  if (p.pixel_count != nullptr) return p.pixel_count[t] > 0;
  const int x = p.shape.shown_x_px + static_cast<int>(t) % p.shape.tiles_x * tile_size_px;
  const int y = p.shape.shown_y_px + static_cast<int>(t) / p.shape.tiles_x * tile_size_px;
  return x > -tile_size_px && y > -tile_size_px && x < p.shape.width_px && y < p.shape.height_px;
}

__device__ Cut cut_of(const SplitParams& p, std::uint32_t t) {
  Cut cut{p.range[t], is_seen(p, t), last_reach(p, t), 0, 0, 0};
  cut = cut.whole();
  if (!p.split || !cut.seen) return cut;
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
struct Places {
  std::uint32_t slices, slices_without_reserve, runs;
};

struct AddPlaces {
  __device__ Places operator()(const Places& a, const Places& b) const {
    return {a.slices + b.slices, a.slices_without_reserve + b.slices_without_reserve,
            a.runs + b.runs};
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

/// Entries that the reorder stage sorts: somewhat more than will be looked at, because entries from
/// behind may belong in front.
__device__ std::uint32_t ordered_of(const SplitParams& p, const Cut& cut) {
  if (p.runs == nullptr || cut.expected == 0) return 0;
  constexpr std::uint32_t step = 128;
  return min(cut.listed(), (cut.expected + cut.expected / 8 + step - 1) / step * step);
}

__device__ std::uint32_t runs_of(const SplitParams& p, const Cut& cut) {
  return (ordered_of(p, cut) + reorder_run - 1) / reorder_run;
}

__device__ void write_runs(const SplitParams& p, const Cut& cut, std::uint32_t at) {
  const std::uint32_t ordered = ordered_of(p, cut);
  for (std::uint32_t begin = 0; begin < ordered; begin += reorder_run, ++at) {
    const std::uint32_t end = begin + reorder_run;
    p.runs[at] = {cut.range.x + begin, cut.range.x + min(end, ordered), begin > 0, end < ordered,
                  0};
  }
}

/// `first`: the tile's first slice, if any; `place`: its first place in each class of the queue.
__device__ void write_tasks(const SplitParams& p, std::uint32_t t, const Cut& cut,
                            std::uint32_t first, const std::uint32_t (&place)[queue_classes]) {
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
    for (int part = 0; part < p.shape.tile_parts && slices > 1; ++part)
      p.slice_transmittance[slice_part(p.shape, first + s, part)] = 1.0f;
    const bool in_last = s >= cut.slices || s + 1 >= queue_classes;
    const std::uint32_t c = in_last ? queue_classes - 1 : s;
    const std::uint32_t earlier = in_last ? s - min(cut.slices, queue_classes - 1u) : 0;
    p.queue[c * p.shape.tiles() + place[c] + earlier] = first_task + s;
  }
}

/// Finds room for slices of the block's tiles: for all, for those that will be looked at, or for
/// none. `cut` becomes what is left for this thread's tile. Returns its first slice.
__device__ std::uint32_t make_room(const SplitParams& p, Cut& cut, const Places& before,
                                   const Places& all) {
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
  let_next_kernel_begin();
  if (p.counts->unlisted != 0) return;  // no tasks, no runs: the frame will be drawn again
  using Scan = cub::BlockScan<Places, split_block>;
  __shared__ Scan::TempStorage scratch;
  __shared__ std::uint32_t queued[queue_classes];  // by the block; then before the block
  __shared__ std::uint32_t first_run;
  const std::uint32_t tiles = p.shape.tiles();
  const std::uint32_t t = blockIdx.x * split_block + threadIdx.x;
  const bool present = t < tiles;
  Cut cut = present ? cut_of(p, t) : Cut{};
  Places before{}, all{};
  Scan(scratch).ExclusiveScan({cut.stored(), cut.without_reserve().stored(), runs_of(p, cut)},
                              before, Places{}, AddPlaces{}, all);
  if (threadIdx.x < queue_classes) queued[threadIdx.x] = 0;
  if (threadIdx.x == 0) first_run = atomicAdd(&p.counts->runs, all.runs);
  const unsigned long long expected = __reduce_add_sync(~0u, cut.expected);
  const std::uint32_t longest = __reduce_max_sync(~0u, cut.listed());
  if (threadIdx.x % warp_size == 0) {
    atomicAdd(&p.counts->expected_entries, expected);
    atomicMax(&p.counts->list_max, longest);
  }
  __syncthreads();
  if (present && p.runs != nullptr) {
    write_runs(p, cut, first_run + before.runs);
    p.ordered[t] = ordered_of(p, cut);
  }
  const std::uint32_t first = make_room(p, cut, before, all);
  std::uint32_t place[queue_classes];
#pragma unroll
  for (int c = 0; c < queue_classes; ++c) {
    const std::uint32_t n = present ? queued_in(c, cut) : 0;
    place[c] = n > 0 ? atomicAdd(&queued[c], n) : 0;
  }
  __syncthreads();
  if (threadIdx.x < queue_classes)
    queued[threadIdx.x] = atomicAdd(&p.counts->queued[threadIdx.x], queued[threadIdx.x]);
  __syncthreads();
  if (!present) return;
#pragma unroll
  for (int c = 0; c < queue_classes; ++c) place[c] += queued[c];
  p.reach[t] = cut.seen ? 0 : cut.reach;
  p.tile_slices[t] = make_uint2(first, cut.stored());
  write_tasks(p, t, cut, first, place);
}

constexpr int composite_block = tile_size_px * tile_size_px;

/// A pixel of a tile: its place in the picture, and the part that it was blended in.
struct TilePixel {
  int x_px, y_px, part;
};

__device__ TilePixel square_pixel(const CompositeParams& p, int tile, int in_tile) {
  const int x = in_tile % tile_size_px, y = in_tile / tile_size_px;
  return {p.shape.shown_x_px + tile % p.shape.tiles_x * tile_size_px + x,
          p.shape.shown_y_px + tile / p.shape.tiles_x * tile_size_px + y,
          y / part_size_px * (tile_size_px / part_size_px) + x / part_size_px};
}

__device__ TilePixel run_pixel(const CompositeParams& p, int tile, int in_tile) {
  const PixelPlace place =
      p.pixels[static_cast<std::size_t>(tile) * run_bound_px(p.shape) + in_tile];
  return {place.x, place.y, in_tile / part_pixels};
}

/// Blends one pixel's slices and writes it. Returns one past the last entry that it looked at.
__device__ std::uint32_t fold(const CompositeParams& p, uint2 slices, int in_tile,
                              const TilePixel& at) {
  math::PixelState<float> pixel = math::empty_pixel<float>();
  std::uint32_t looked_at = 0;
  for (std::uint32_t s = slices.x; s < slices.x + slices.y; ++s) {
    const float4 slice = p.slice_pixels[slice_pixel(p.shape, s, in_tile)];
    pixel.colour.x += pixel.transmittance * slice.x;
    pixel.colour.y += pixel.transmittance * slice.y;
    pixel.colour.z += pixel.transmittance * slice.z;
    pixel.transmittance *= fabsf(slice.w);
    looked_at = p.consumed[slice_part(p.shape, s, at.part)];
    const bool finished = signbit(slice.w);
    if (finished || pixel.transmittance < static_cast<float>(transmittance_min)) break;
  }
  show_pixel(p.rgb, p.shape, at.x_px, at.y_px, pixel, p.background);
  return looked_at;
}

__global__ void __launch_bounds__(composite_block) composite_kernel(const CompositeParams p) {
  wait_for_earlier_work();
  if (p.counts->unlisted != 0) return;
  using Reduce = cub::BlockReduce<std::uint32_t, composite_block>;
  __shared__ Reduce::TempStorage scratch;
  const std::uint32_t tile = blockIdx.x;
  const uint2 slices = p.tile_slices[tile];
  if (slices.y == 0) return;
  const int index = static_cast<int>(tile), thread = static_cast<int>(threadIdx.x);
  std::uint32_t looked_at = 0;
  if (p.pixels == nullptr) {
    looked_at = fold(p, slices, thread, square_pixel(p, index, thread));
  } else {
    const int count = static_cast<int>(p.pixel_count[tile]);
    for (int k = thread; k < count; k += composite_block)
      looked_at = max(looked_at, fold(p, slices, k, run_pixel(p, index, k)));
  }
  looked_at =
      Reduce(scratch).Reduce(looked_at, [](std::uint32_t a, std::uint32_t b) { return max(a, b); });
  if (thread == 0) p.reach[tile] = looked_at - p.tasks[p.shape.tiles() + slices.x].first;
}

}  // namespace

void launch_split(const SplitParams& params, cudaStream_t stream) {
  split_kernel<<<blocks_for(params.shape.tiles(), split_block), split_block, 0, stream>>>(params);
  check_launch("split");
}

void launch_composite(const CompositeParams& params, cudaStream_t stream) {
  launch_early("composite", composite_kernel, params.shape.tiles(), composite_block, stream,
               params);
}

}  // namespace catgs::cuda
