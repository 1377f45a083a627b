#include "render_core/cuda/blend_round.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/early_launch.cuh"
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

/// Shared by the lanes of a warp.
struct __align__(16) WarpScratch {
  StagedHalf staged[halves];  // splats that wait for the halves of its part
  Box box[halves];            // of parts that are not squares
  // A column for each lane.
  PixelPlaces places[halves][warp_size];
  float4 fetched[2][lane_splats][2][warp_size];  // records of this group and the next
};

/// Splats of a list, in groups. Two loads are in flight while a group is blended: the next group's
/// records, and the slots of the one after it.
class Groups {
 public:
  __device__ Groups(const BlendParams& p, const BlendTask& task, WarpScratch& scratch)
      : records_(p.records),
        slots_(p.slot),
        next_(task.first),
        last_(task.last),
        mine_(&scratch.fetched[0][0][0][threadIdx.x % warp_size]) {
    load_slots(next_);
    fetch();
  }

  __device__ bool more() const { return next_ < last_; }
  /// One past the last entry taken.
  __device__ std::uint32_t taken() const { return min(next_, last_); }

  /// Makes the next group available.
  __device__ void take() {
    next_ += group_splats;
    buffer_ ^= 1u;
    fetch();
    asm volatile("cp.async.wait_group 1;" ::: "memory");
  }
  /// The lane's i-th splat of the group. All splats with i = 0 come before those with i = 1.
  __device__ SplatRecord splat(unsigned i) const {
    const float4* words = &mine_[(buffer_ ^ 1u) * buffer_words + i * splat_words];
    const float4 a = words[0], b = words[warp_size];
    return {{a.x, a.y}, {a.z, a.w, b.x}, b.y, reinterpret_cast<const PackedColour&>(b.z)};
  }

 private:
  static constexpr std::uint32_t no_slot = ~0u;

  __device__ void load_slots(std::uint32_t first) {
#pragma unroll
    for (unsigned i = 0; i < lane_splats; ++i) {
      const std::uint32_t at = first + i * warp_size + threadIdx.x % warp_size;
      slot_[i] = at < last_ ? __ldg(&slots_[at]) : no_slot;
    }
  }

  /// Starts loading the records of the group at next_, and loads the slots of the group after it.
  __device__ void fetch() {
#pragma unroll
    for (unsigned i = 0; i < lane_splats; ++i) {
      float4* to = &mine_[buffer_ * buffer_words + i * splat_words];
      if (slot_[i] != no_slot) {
        asm volatile(
            "cp.async.ca.shared.global [%0], [%1], 16;"
            "cp.async.ca.shared.global [%0 + %2], [%1 + 16], 16;" ::"r"(
                static_cast<std::uint32_t>(__cvta_generic_to_shared(to))),
            "l"(&records_[slot_[i]]), "n"(warp_size * sizeof(float4))
            : "memory");
      } else {
        to[0] = make_float4(0.0f, 0.0f, 1.0f, 0.0f);
        to[warp_size] = make_float4(1.0f, never, 0.0f, 0.0f);
      }
    }
    asm volatile("cp.async.commit_group;" ::: "memory");
    load_slots(next_ + group_splats);
  }

  // In elements of `fetched`.
  static constexpr unsigned splat_words = 2 * warp_size, buffer_words = lane_splats * splat_words;

  const SplatRecord* records_;
  const std::uint32_t* slots_;
  std::uint32_t next_, last_;        // list entries
  std::uint32_t slot_[lane_splats];  // of the group to fetch next
  unsigned buffer_ = 0;              // the buffer that it goes to
  float4* mine_;                     // the lane's column of fetched
};

/// Whether a splat centred at `centre` reaches the box with alpha_min. The minimum of a convex
/// quadratic over a box is at the centre, or on a line through the nearest point of the box in x or
/// in y.
struct BoxTest {
  math::Whitening<float> w;
  float2 centre;
  float reach, y_per_x, x_per_y;

  __device__ bool reaches(const Box& box) const {
    const float low_x = box.low_x - centre.x, high_x = box.high_x - centre.x;
    const float low_y = box.low_y - centre.y, high_y = box.high_y - centre.y;
    const float x = math::clamp(0.0f, low_x, high_x);
    const float y = math::clamp(0.0f, low_y, high_y);
    const float y_for_x = math::clamp(y_per_x * x, low_y, high_y);
    const float x_for_y = math::clamp(x_per_y * y, low_x, high_x);
    return fminf(math::whitened_square<float>(w, {x, y_for_x}),
                 math::whitened_square<float>(w, {x_for_y, y})) <= reach;
  }
};

/// `centre` is relative to the origin of the boxes.
__device__ BoxTest make_box_test(const SplatRecord& splat, float2 centre) {
  const math::Whitening<float>& w = splat.whitening;
  return {w, centre, math::reach_of(splat.log2_opacity) + 1e-3f,
          __fdividef(-w.xx * w.xy, w.xy * w.xy + w.yy * w.yy), __fdividef(-w.xy, w.xx)};
}

/// Splats that wait in the ring of a half part.
struct Waiting {
  unsigned first = 0;  // place in the ring where a round begins
  unsigned count = 0;
};

/// Stages the splats of a group for each unfinished half that they reach.
template <class Pixels>
__device__ void stage(WarpScratch& scratch, const Pixels& pixels, const Groups& groups,
                      const bool (&live)[halves], Waiting (&waiting)[halves]) {
  const unsigned lanes_before = (1u << threadIdx.x % warp_size) - 1u;
  StagedSplat splat[lane_splats];
  unsigned hits[lane_splats][halves];  // lanes
#pragma unroll
  for (unsigned i = 0; i < lane_splats; ++i) {
    const SplatRecord record = groups.splat(i);
    const float2 centre =
        make_float2(record.centre_px.x - pixels.origin_x(), record.centre_px.y - pixels.origin_y());
    const BoxTest test = make_box_test(record, centre);
    splat[i] = staged_splat(
        math::exponent_field<float>(record.whitening, {centre.x, centre.y}, record.log2_opacity),
        reinterpret_cast<const uint2&>(record.colour));
#pragma unroll
    for (int half = 0; half < halves; ++half)
      hits[i][half] =
          __ballot_sync(~0u, test.reaches(Pixels::box(scratch.box, half)) && live[half]);
  }
  __syncwarp();  // all lanes have read the last round
#pragma unroll
  for (int half = 0; half < halves; ++half) {
#pragma unroll
    for (unsigned i = 0; i < lane_splats; ++i) {
      const unsigned lanes = hits[i][half];
      const unsigned place =
          waiting[half].first + waiting[half].count + __popc(lanes & lanes_before);
      scratch.staged[half].put_if((lanes & (lanes_before + 1u)) != 0, StagedHalf::wrapped(place),
                                  splat[i]);
      waiting[half].count += __popc(lanes);
    }
  }
  __syncwarp();
}

/// Pads the halves' rounds with splats that contribute nothing.
__device__ void fill_up(WarpScratch& scratch, const Waiting (&waiting)[halves]) {
  const unsigned place = threadIdx.x % warp_size;
#pragma unroll
  for (int half = 0; half < halves; ++half) {
    if (place >= waiting[half].count)
      *reinterpret_cast<uint2*>(scratch.staged[half].at(
          StagedHalf::wrapped(waiting[half].first + place), 0)) = split_pair(least_exponent, 0.0f);
  }
  __syncwarp();
}

/// The largest transmittance that earlier slices of the task's tile leave in this part, as far as
/// they are known to be finished.
__device__ float transmittance_before(const BlendParams& p, std::uint32_t slice, int place,
                                      int part) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  float product = 1.0f;
  for (int back = 1 + lane; back <= place; back += warp_size) {
    const volatile float* known = p.slice_transmittance;
    product *= known[slice_part(p.shape, slice - back, part)];
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

template <class Pixels>
__device__ void store(const BlendParams& p, const BlendTask& task, std::uint32_t slice,
                      const Pixels& pixels, const States& states) {
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) {
    if (Pixels::most_parts == most_run_parts && !pixels.inside(p.shape, i)) continue;
    if (task.slices > 1) {
      const math::Vec3<float>& c = states[i].colour;
      p.slice_pixels[slice_pixel(p.shape, slice, pixels.in_tile(i))] =
          make_float4(c.x, c.y, c.z, states[i].transmittance);
    } else {
      const int2 place = pixels.place(i);
      show_pixel(p.rgb, p.shape, place.x, place.y, states[i], p.background);
    }
  }
}

/// Marks finished pixels by the sign, as in math::PixelState.
__device__ float finished_by_sign(float transmittance) {
  return is_live(transmittance) ? transmittance : -transmittance;
}

/// Moves the pixels of the halves to the lanes that store them.
__device__ void gather_states(WarpScratch& scratch, const HalfPixels (&half_pixels_of)[halves],
                              States& states) {
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
              from.colour[2 * row],
              holds == 0 ? from.colour[2 * row + 1] : finished_by_sign(from.transmittance[row]));
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

template <bool count_pairs, class Pixels>
__device__ void blend_part(const BlendParams& p, WarpScratch& scratch, std::uint32_t task_index,
                           int part) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const BlendTask task = load_task(p, task_index);
  const std::uint32_t slice = task_index - p.shape.tiles();  // its index if it is a slice
  const Pixels pixels(p, scratch.box, task.tile, part);
  if (pixels.empty()) return;
  unsigned long long pairs = 0;
  const auto behind_finished = [&] {
    // The limit is halved, so that rounding cannot make the composite use a slice that was not
    // blended.
    return task.slice > 0 && transmittance_before(p, slice, task.slice, part) <
                                 0.5f * static_cast<float>(transmittance_min);
  };
  if (behind_finished()) return;  // the composite will not use this part of the slice
  Groups groups(p, task, scratch);
  PixelPlaces(&places)[halves][warp_size] = scratch.places;
  HalfPixels half[halves] = {take_half(pixels, p.shape, 0, places[0][lane]),
                             take_half(pixels, p.shape, 1, places[1][lane])};
  bool live[halves] = {half[0].live(), half[1].live()};
  Waiting waiting[halves];
  for (int group = 0; live[0] || live[1]; ++group) {
    const bool more = groups.more();
    if (more) {
      groups.take();
      stage(scratch, pixels, groups, live, waiting);
    } else {
      fill_up(scratch, waiting);
    }
    const unsigned enough = more ? round_splats : 1;
#pragma unroll
    for (int h = 0; h < halves; ++h) {
      while (live[h] && waiting[h].count >= enough) {
        pairs +=
            blend_round<count_pairs>(half[h], places[h][lane], scratch.staged[h], waiting[h].first);
        waiting[h].first = StagedHalf::wrapped(waiting[h].first + round_splats);
        waiting[h].count -= min(waiting[h].count, unsigned{round_splats});
        live[h] = half[h].live();
      }
    }
    if (!more || (group % 2 == 1 && behind_finished())) break;
  }
  asm volatile("cp.async.wait_all;" ::: "memory");
  if (count_pairs) atomicAdd(&p.counts->blended_pairs, pairs);
  States states;
  gather_states(scratch, half, states);
  store(p, task, slice, pixels, states);

  const std::uint32_t consumed = groups.taken();
  float largest = 0.0f;  // of unfinished pixels: nothing behind shows in the finished ones
#pragma unroll
  for (int i = 0; i < pixels_per_lane; ++i) largest = fmaxf(largest, states[i].transmittance);
  largest = __uint_as_float(__reduce_max_sync(~0u, __float_as_uint(largest)));
  if (lane != 0) return;
  if (task.slices > 1) {
    const std::uint32_t at = slice_part(p.shape, slice, part);
    p.consumed[at] = consumed;
    volatile float* known = p.slice_transmittance;
    known[at] = largest;
  } else {
    atomicMax(&p.reach[task.tile], consumed - task.first);
  }
}

/// Warps take parts from a queue, so that none waits for the longest part of its tile or block.
template <bool count_pairs, class Pixels>
__global__ void __launch_bounds__(block_size, blocks_per_processor)
    blend_kernel(const BlendParams p) {
  let_next_kernel_begin();
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
    std::uint32_t place = work / Pixels::most_parts;
    int queue_class = 0;
    for (; queue_class < queue_classes; ++queue_class) {
      const std::uint32_t queued = p.counts->queued[queue_class];
      if (place < queued) break;
      place -= queued;
    }
    if (queue_class == queue_classes) return;
    const std::uint32_t task = p.queue[queue_class * p.shape.tiles() + place];
    blend_part<count_pairs, Pixels>(p, scratch[warp], task,
                                    static_cast<int>(work % Pixels::most_parts));
    __syncwarp();
  }
}

}  // namespace

int blend_warps(int processors) {
  int blocks = 0;
  check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, blend_kernel<false, SquarePixels>,
                                                      block_size, 0),
        "occupancy");
  return processors * blocks * warps_per_block;
}

void launch_blend(const BlendParams& params, cudaStream_t stream) {
  const bool runs = params.pixels != nullptr;
  const auto kernel =
      params.count_pairs
          ? (runs ? blend_kernel<true, RunPixels> : blend_kernel<true, SquarePixels>)
          : (runs ? blend_kernel<false, RunPixels> : blend_kernel<false, SquarePixels>);
  kernel<<<params.warps / warps_per_block, block_size, 0, stream>>>(params);
  check_launch("blend");
}

}  // namespace catgs::cuda
