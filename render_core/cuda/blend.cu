#include "render_core/cuda/blend_round.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/part_pixels.cuh"
#include "render_core/cuda/pixel.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/math/constants.h"

namespace catgs::cuda {
namespace {

constexpr int warps_per_block = 2;
constexpr int block_size = warps_per_block * warp_size;
// The largest number that leaves a thread the 128 registers of a round. Their shared memory, 26 KB
// each, fits on Hopper; other generations run fewer at a time.
constexpr int blocks_per_processor = 8;

/// Splats of a lane in a group. Work on one hides the latency of the other.
constexpr unsigned lane_splats = 2;
constexpr unsigned group_splats = lane_splats * warp_size;

/// Entries of a list that a warp scans at a time. Their loads hide each other's latency.
constexpr unsigned scan_steps = 4;
constexpr unsigned scan_entries = scan_steps * warp_size;

/// Room for hits: fewer than a group, and those of a scan.
constexpr unsigned hit_room = 256;
static_assert(hit_room >= group_splats + scan_entries);

/// Shared by the lanes of a warp.
struct __align__(16) WarpScratch {
  StagedHalf staged[halves];  // splats that wait for the halves of its part
  // A column for each lane.
  PixelPositions positions[halves][warp_size];
  float4 fetched[2][lane_splats][2][warp_size];  // records of this group and the next
  std::uint32_t hits[hit_room];  // list entries that reach live halves and wait to be fetched
};

/// Finds the entries of a list that reach a part. The masks of the next entries are being loaded
/// meanwhile.
class HitScan {
 public:
  /// A group of list entries, front to back: the lane's share, and what all lanes know.
  struct Group {
    TileEntry entry[lane_splats] = {};  // all with index 0 come before those with index 1
    unsigned count = 0;                 // of all lanes
    std::uint32_t end = 0;              // one past the last list entry of the group
  };

  __device__ HitScan(const BlendParams& p, const BlendTask& task, std::uint32_t* hits)
      : entries_(p.entries), hits_(hits), at_(task.first), last_(task.last) {
    load_blocks();
  }

  /// The next group of entries that reach any of `blocks`; their loads have begun.
  __device__ Group next(std::uint32_t blocks) {
    const unsigned lane = threadIdx.x % warp_size, lanes_before = (1u << lane) - 1u;
    while (waiting_ < group_splats && at_ < last_) {
#pragma unroll
      for (unsigned j = 0; j < scan_steps; ++j) {
        const bool hit = (blocks_[j] & blocks) != 0;
        const unsigned lanes = __ballot_sync(~0u, hit);
        if (hit)
          hits_[(first_ + waiting_ + __popc(lanes & lanes_before)) % hit_room] =
              at_ + j * warp_size + lane;
        waiting_ += __popc(lanes);
      }
      at_ += scan_entries;
      load_blocks();
    }
    __syncwarp();
    Group group;
    group.count = min(waiting_, group_splats);
    if (group.count > 0) group.end = hits_[(first_ + group.count - 1) % hit_room] + 1;
#pragma unroll
    for (unsigned i = 0; i < lane_splats; ++i) {
      const unsigned k = i * warp_size + lane;
      if (k >= group.count) continue;
      const uint2 words =
          __ldg(reinterpret_cast<const uint2*>(&entries_[hits_[(first_ + k) % hit_room]]));
      group.entry[i] = {words.x, words.y};
    }
    first_ = (first_ + group.count) % hit_room;
    waiting_ -= group.count;
    return group;
  }

 private:
  __device__ void load_blocks() {
#pragma unroll
    for (unsigned j = 0; j < scan_steps; ++j) {
      const std::uint32_t at = at_ + j * warp_size + threadIdx.x % warp_size;
      blocks_[j] = at < last_ ? __ldg(&entries_[at].blocks) : 0;
    }
  }

  const TileEntry* entries_;
  std::uint32_t* hits_;               // a ring
  unsigned first_ = 0, waiting_ = 0;  // in it
  std::uint32_t at_, last_;           // list entries
  std::uint32_t blocks_[scan_steps];  // of the entries from at_ on
};

/// Splats of a list that reach a part, in groups. Two loads are in flight while a group is blended:
/// the next group's records, and the entries of the one after it.
class Groups {
 public:
  /// `blocks`: those of the part's halves, a bit each.
  __device__ Groups(const BlendParams& p, const BlendTask& task, std::uint32_t blocks,
                    WarpScratch& scratch)
      : records_(p.records),
        scan_(p, task, scratch.hits),
        mine_(&scratch.fetched[0][0][0][threadIdx.x % warp_size]) {
    current_.end = task.first;
    next_ = scan_.next(blocks);
    fetch(blocks);
  }

  /// Whether take() will find a splat.
  __device__ bool more() const { return fetched_.count > 0; }
  /// One past the last entry taken.
  __device__ std::uint32_t taken() const { return current_.end; }

  /// Makes the next group available. `blocks`: of the halves that still need splats.
  __device__ void take(std::uint32_t blocks) {
    current_ = fetched_;
    buffer_ ^= 1u;
    fetch(blocks);
    asm volatile("cp.async.wait_group 1;" ::: "memory");
  }
  /// The lane's i-th splat of the group. All splats with i = 0 come before those with i = 1.
  __device__ SplatRecord splat(unsigned i) const {
    const float4* words = &mine_[(buffer_ ^ 1u) * buffer_words + i * splat_words];
    const float4 a = words[0], b = words[warp_size];
    return {{a.x, a.y}, {a.z, a.w, b.x}, b.y, reinterpret_cast<const PackedColour&>(b.z)};
  }
  /// The blocks that this splat reaches.
  __device__ std::uint32_t blocks(unsigned i) const { return current_.entry[i].blocks; }

 private:
  /// Starts loading the records of the next group, and the entries of the group after it.
  __device__ void fetch(std::uint32_t blocks) {
#pragma unroll
    for (unsigned i = 0; i < lane_splats; ++i) {
      float4* to = &mine_[buffer_ * buffer_words + i * splat_words];
      if (next_.entry[i].blocks != 0) {
        asm volatile(
            "cp.async.ca.shared.global [%0], [%1], 16;"
            "cp.async.ca.shared.global [%0 + %2], [%1 + 16], 16;" ::"r"(
                static_cast<std::uint32_t>(__cvta_generic_to_shared(to))),
            "l"(&records_[next_.entry[i].slot]), "n"(warp_size * sizeof(float4))
            : "memory");
      }
    }
    asm volatile("cp.async.commit_group;" ::: "memory");
    fetched_ = next_;
    if (fetched_.count > 0) next_ = scan_.next(blocks);
  }

  // In elements of `fetched`.
  static constexpr unsigned splat_words = 2 * warp_size, buffer_words = lane_splats * splat_words;

  const SplatRecord* records_;
  HitScan scan_;
  HitScan::Group current_, fetched_, next_;
  unsigned buffer_ = 0;  // the buffer that the next group goes to
  float4* mine_;         // the lane's column of fetched
};

/// Splats that wait in the ring of a half part.
struct Waiting {
  unsigned first = 0;  // place in the ring where a round begins
  unsigned count = 0;
};

/// No splat that reaches a pixel of a part has more than this as its whitened square at the part's
/// origin. A splat is at least as wide as its low-pass filter, so the square's root grows by 1.56 a
/// pixel at most. Pixels lie within 5 px, and there it is 2.83 at most. Halves hold the
/// coefficients of such splats, but not of those far away.
constexpr float most_at_origin = 128.0f;

/// Stages the splats of a group for each unfinished half that they reach. `live`: those halves'
/// blocks.
template <bool loose>
__device__ void stage(WarpScratch& scratch, const PartPixels& pixels, const Groups& groups,
                      const std::uint32_t (&live)[halves], Waiting (&waiting)[halves]) {
  const unsigned lanes_before = (1u << threadIdx.x % warp_size) - 1u;
  StagedSplat splat[lane_splats];
  unsigned hits[lane_splats][halves];  // lanes
#pragma unroll
  for (unsigned i = 0; i < lane_splats; ++i) {
    const SplatRecord record = groups.splat(i);
    const float x = record.centre_px.x - pixels.origin_x();
    const float y = record.centre_px.y - pixels.origin_y();
    const auto field = math::exponent_field<float>(record.whitening, {x, y}, record.log2_opacity);
    const unsigned met = loose ? halves_met(__half2float(record.colour.half_side_px), x, y) : ~0u;
    splat[i] = staged_splat(field, reinterpret_cast<const uint2&>(record.colour));
    // With a window, a list has splats that reach nothing now, or are far from here.
    const bool near = math::reach_of(record.log2_opacity) >= 0.0f &&
                      field.u * field.u + field.v * field.v <= most_at_origin;
#pragma unroll
    for (int half = 0; half < halves; ++half)
      hits[i][half] = __ballot_sync(
          ~0u, near && (met >> half & 1u) != 0 && (groups.blocks(i) & live[half]) != 0);
  }
  __syncwarp();  // all lanes have read the last round
#pragma unroll
  for (int half = 0; half < halves; ++half) {
#pragma unroll
    for (unsigned i = 0; i < lane_splats; ++i) {
      const unsigned lanes = hits[i][half];
      const unsigned position =
          waiting[half].first + waiting[half].count + __popc(lanes & lanes_before);
      scratch.staged[half].put_if((lanes & (lanes_before + 1u)) != 0, StagedHalf::wrapped(position),
                                  splat[i]);
      waiting[half].count += __popc(lanes);
    }
  }
  __syncwarp();
}

/// Pads the halves' rounds with splats that contribute nothing.
__device__ void fill_up(WarpScratch& scratch, const Waiting (&waiting)[halves]) {
  const unsigned position = threadIdx.x % warp_size;
#pragma unroll
  for (int half = 0; half < halves; ++half) {
    if (position >= waiting[half].count)
      *reinterpret_cast<uint2*>(
          scratch.staged[half].at(StagedHalf::wrapped(waiting[half].first + position), 0)) =
          split_pair(least_exponent, 0.0f);
  }
  __syncwarp();
}

/// The largest transmittance that earlier slices of the task's tile leave in this part, as far as
/// they are known to be finished.
__device__ float transmittance_before(const BlendParams& p, std::uint32_t slice, int position,
                                      int part) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  float product = 1.0f;
  for (int back = 1 + lane; back <= position; back += warp_size) {
    const volatile float* known = p.slice_transmittance;
    product *= known[slice_part(slice - back, part)];
  }
#pragma unroll
  for (int step = warp_size / 2; step > 0; step /= 2)
    product *= __shfl_xor_sync(~0u, product, step);
  return product;
}

__device__ BlendTask load_task(const BlendParams& p, std::uint32_t task) {
  const uint4 words = __ldg(reinterpret_cast<const uint4*>(&p.tasks[task]));
  return {words.x, words.y, words.z, static_cast<std::uint16_t>(words.w & 0xffffu),
          static_cast<std::uint16_t>(words.w >> 16)};
}

using States = math::PixelState<float>[pixels_per_lane];

__device__ void store(const BlendParams& p, const BlendTask& task, std::uint32_t slice,
                      const PartPixels& pixels, const States& states) {
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) {
    if (task.slices > 1) {
      const math::Vec3<float>& c = states[i].colour;
      p.slice_pixels[slice_pixel(slice, pixels.in_tile(i))] =
          make_float4(c.x, c.y, c.z, states[i].transmittance);
    } else {
      const int2 position = pixels.position(i);
      show_pixel(p.rgb, p.shape, position.x, position.y, states[i], p.background, p.finish);
    }
  }
}

/// The largest of the part's unfinished pixels: nothing behind shows in the finished ones.
__device__ float largest_transmittance(const States& states) {
  float largest = 0.0f;
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) largest = fmaxf(largest, states[i].transmittance);
  return __uint_as_float(__reduce_max_sync(~0u, __float_as_uint(largest)));
}

/// Marks finished pixels by the sign, as in math::PixelState.
__device__ float finished_by_sign(float transmittance, float least) {
  return transmittance >= least ? transmittance : -transmittance;
}

/// Moves the pixels of the halves to the lanes that store them.
__device__ void gather_states(WarpScratch& scratch, const HalfPixels (&half_pixels_of)[halves],
                              float least, States& states) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  __syncwarp();
  const int holds = lane % round_lanes - 2;       // red and green, or blue
  float4* pixels = &scratch.fetched[0][0][0][0];  // no group is fetched any more
  if (holds >= 0) {
#pragma unroll
    for (int half = 0; half < halves; ++half) {
#pragma unroll
      for (int b = 0; b < half_blocks; ++b) {
#pragma unroll
        for (int row = 0; row < 2; ++row) {
          const BlockPixels& from = half_pixels_of[half].block[b];
          const int pixel =
              half * half_pixels + b * block_pixels + row * (block_pixels / 2) + lane / round_lanes;
          reinterpret_cast<float2*>(&pixels[pixel])[holds] = make_float2(
              from.colour[2 * row], holds == 0 ? from.colour[2 * row + 1]
                                               : finished_by_sign(from.transmittance[row], least));
        }
      }
    }
  }
  __syncwarp();
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) {
    const float4 pixel =
        pixels[lane / half_lanes * half_pixels + i * half_lanes + lane % half_lanes];
    states[i] = {{pixel.x, pixel.y, pixel.z}, pixel.w};
  }
}

/// The end of a part that has looked at the entries before `looked_at`, and finished. Called by the
/// whole warp.
template <bool loose>
__device__ float end_of(const BlendParams& p, const BlendTask& task, std::uint32_t looked_at) {
  if (!loose) return p.ends.splat_depth[p.entries[looked_at - 1].slot];
  static_assert(loose_end_entries == warp_size);
  const std::uint32_t back = 1 + threadIdx.x % warp_size;
  const std::uint32_t at = looked_at - min(back, looked_at - task.first);
  // Depths of splats in front of the camera are positive, so their bits compare as they do.
  const float depth = fmaxf(p.ends.splat_depth[p.entries[at].slot], 0.0f);
  return __uint_as_float(__reduce_max_sync(~0u, __float_as_uint(depth)));
}

template <bool loose, bool count_pairs>
__device__ void blend_part(const BlendParams& p, WarpScratch& scratch, std::uint32_t task_index,
                           int part) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const BlendTask task = load_task(p, task_index);
  const std::uint32_t slice = task_index - p.shape.tiles();  // its index if it is a slice
  const PartPixels pixels(p.shape, task.tile, part);
  if (!pixels.shows(p.shape)) return;
  const float least = p.finish.transmittance;
  unsigned long long pairs = 0;
  const auto behind_finished = [&] {
    // Halved, so that rounding cannot make the composite use a slice that was not blended.
    return task.slice > 0 && transmittance_before(p, slice, task.slice, part) < 0.5f * least;
  };
  if (behind_finished()) return;  // the composite will not use this part of the slice
  const std::uint32_t first_block = first_block_of(part);
  std::uint32_t live[halves] = {first_block, first_block << blocks_across};
  Groups groups(p, task, live[0] | live[1], scratch);
  PixelPositions(&positions)[halves][warp_size] = scratch.positions;
  HalfPixels half[halves] = {take_half(pixels, p.shape, 0, positions[0][lane]),
                             take_half(pixels, p.shape, 1, positions[1][lane])};
#pragma unroll
  for (int h = 0; h < halves; ++h)
    if (!half[h].live(least)) live[h] = 0;
  Waiting waiting[halves];
  for (int group = 0; (live[0] | live[1]) != 0; ++group) {
    const bool more = groups.more();
    if (more) {
      groups.take(live[0] | live[1]);
      stage<loose>(scratch, pixels, groups, live, waiting);
    } else {
      fill_up(scratch, waiting);
    }
    const unsigned enough = more ? round_splats : 1;
#pragma unroll
    for (int h = 0; h < halves; ++h) {
      while (live[h] != 0 && waiting[h].count >= enough) {
        pairs += blend_round<count_pairs>(half[h], positions[h][lane], scratch.staged[h],
                                          waiting[h].first, least);
        waiting[h].first = StagedHalf::wrapped(waiting[h].first + round_splats);
        waiting[h].count -= min(waiting[h].count, unsigned{round_splats});
        if (!half[h].live(least)) live[h] = 0;
      }
    }
    if (!more || (group % 2 == 1 && behind_finished())) break;
  }
  asm volatile("cp.async.wait_all;" ::: "memory");
  if (count_pairs) atomicAdd(&p.counts->blended_pairs, pairs);
  States states;
  gather_states(scratch, half, least, states);
  store(p, task, slice, pixels, states);

  const float largest = largest_transmittance(states);
  const std::uint32_t looked_at = groups.taken();
  const bool finished = largest <= 0.0f && looked_at > task.first;
  const bool ends = p.ends.depth != nullptr && task.slices == 1;
  const float end = ends && finished ? end_of<loose>(p, task, looked_at) : INFINITY;
  if (lane != 0) return;
  if (task.slices > 1) {
    const std::uint32_t at = slice_part(slice, part);
    p.consumed[at] = looked_at;
    volatile float* known = p.slice_transmittance;
    known[at] = largest;
    return;
  }
  atomicMax(&p.reach[task.tile], looked_at - task.first);
  if (ends) p.ends.note(task.tile, part, end);
}

/// Warps take parts from a queue, so that none waits for the longest part of its tile or block.
template <bool loose, bool count_pairs>
__global__ void __launch_bounds__(block_size, blocks_per_processor)
    blend_kernel(const BlendParams p) {
  __shared__ WarpScratch scratch[warps_per_block];
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const int warp = static_cast<int>(threadIdx.x) / warp_size;
  // Padding sets one pair of coefficients only, so the others must be finite.
  std::uint32_t* words = reinterpret_cast<std::uint32_t*>(scratch);
  for (unsigned i = threadIdx.x; i < sizeof(scratch) / sizeof(*words); i += block_size)
    words[i] = 0;
  __syncthreads();
  for (;;) {
    std::uint32_t work = 0;
    if (lane == 0) work = atomicAdd(&p.counts->next_part, 1u);
    work = __shfl_sync(~0u, work, 0);
    std::uint32_t position = work / parts_per_tile;
    int queue_class = 0;
    for (; queue_class < queue_classes; ++queue_class) {
      const std::uint32_t queued = p.counts->queued[queue_class];
      if (position < queued) break;
      position -= queued;
    }
    if (queue_class == queue_classes) return;
    const std::uint32_t task = p.queue[queue_class * p.shape.tiles() + position];
    blend_part<loose, count_pairs>(p, scratch[warp], task, static_cast<int>(work % parts_per_tile));
    __syncwarp();
  }
}

}  // namespace

int blend_warps(int processors) {
  int blocks = 0;
  check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, blend_kernel<false, false>,
                                                      block_size, 0),
        "occupancy");
  return processors * blocks * warps_per_block;
}

void launch_blend(const BlendParams& params, cudaStream_t stream) {
  const auto kernel =
      params.loose ? params.count_pairs ? blend_kernel<true, true> : blend_kernel<true, false>
      : params.count_pairs ? blend_kernel<false, true>
                           : blend_kernel<false, false>;
  kernel<<<params.warps / warps_per_block, block_size, 0, stream>>>(params);
  check_launch("blend");
}

}  // namespace catgs::cuda
