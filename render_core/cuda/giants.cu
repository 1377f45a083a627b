#include "render_core/cuda/early_launch.cuh"
#include "render_core/cuda/giants.cuh"
#include "render_core/cuda/reorder.cuh"
#include "render_core/cuda/warp_sums.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 128;

// A fuller set is too full to tell giants from others. No scene was seen to reach this.
constexpr std::uint32_t most_giants = giant_bits / 4;

// Limits for the list of one tile: giants that are carried, and all entries that move, which
// include one neighbour for each boundary that a giant passes. A tile with more moves keeps its
// list as it is.
constexpr std::uint32_t found_per_thread = 4, most_found = found_per_thread * block_size;
constexpr std::uint32_t most_moves = 1536;

// The parts of a list: at most 31 runs of the reorder stage, then the rest of the list. The rest is
// hardly looked at and unordered. Giants that are carried there are out of the way, and neighbours
// that took their places may stand too far back.
constexpr std::uint32_t most_parts = warp_size;

/// A block's working data for the list of one tile.
struct Notes {
  std::uint32_t bits[giant_words];  // GiantSet::bits
  std::uint32_t found;              // giants to be carried; may exceed the size of `at`
  std::uint32_t at[most_found];
  // For each part of the list.
  std::uint32_t begin[most_parts + 1];
  std::uint32_t depth[most_parts];    // key of one of its first entries
  std::uint32_t leaving[most_parts];  // giants that belong to another part
  int gain[most_parts];               // giants that come, minus giants that leave
  int gives[most_parts];              // neighbours that move to the next part; negative: from it
  // Each moving entry leaves a place and takes another. Both are noted by part, and each part has
  // as many of one as of the other.
  std::uint32_t moves;
  std::uint32_t left[most_moves];   // places in the list
  std::uint32_t taken[most_moves];  // slots
  std::uint32_t next_left[most_parts], next_taken[most_parts];
  bool lacking;  // a part has too few neighbours to give, so nothing moves
};

struct List {
  std::uint32_t* slot;
  std::uint32_t length, ordered;  // entries; entries that are in runs

  __device__ std::uint32_t runs() const {
    return min((ordered + reorder_run - 1) / reorder_run, most_parts - 1);
  }
  __device__ std::uint32_t behind() const { return min(ordered, runs() * reorder_run); }
  __device__ std::uint32_t parts() const { return runs() + (behind() < length ? 1 : 0); }
  __device__ std::uint32_t part_of(std::uint32_t at) const {
    return at < behind() ? at / reorder_run : runs();
  }
};

__device__ bool may_be_giant(const Notes& notes, std::uint32_t slot) {
  return (notes.bits[giant_word(slot)] & giant_bit(slot)) != 0;
}

/// Run by one warp, a lane for each part. Notes where parts begin and at which depths, and clears
/// the moves.
__device__ void begin_parts(const GiantParams& p, const List& list, Notes& notes) {
  const std::uint32_t r = threadIdx.x;
  const std::uint32_t begin = r < list.runs() ? r * reorder_run : list.behind();
  notes.begin[r] = r < list.parts() ? begin : list.length;
  notes.gain[r] = 0;
  notes.leaving[r] = 0;
  if (r == 0) {
    notes.begin[most_parts] = list.length;
    notes.found = 0;
    notes.lacking = false;
  }
  __syncwarp();
  // The depth of a part is not taken from its very first entries, some of which may belong farther
  // in front. Hidden entries do not count, nor giants, which may stand in the wrong part. A part
  // with no other entries is skipped: it takes the depth of the next part.
  constexpr std::uint32_t unknown = ~0u;
  std::uint32_t depth = unknown;
  const std::uint32_t length = notes.begin[r + 1] - notes.begin[r];
  const std::uint32_t end = notes.begin[r] + min(length, reorder_run / 2);
  for (std::uint32_t at = notes.begin[r] + min(length / 2, 16u); at < end && depth == unknown; ++at)
    if (const std::uint32_t slot = list.slot[at]; !may_be_giant(notes, slot))
      depth = p.depth_key[slot] > 0 ? p.depth_key[slot] : unknown;
#pragma unroll
  for (int d = 1; d < warp_size; d *= 2) {
    const std::uint32_t next = __shfl_down_sync(~0u, depth, d);
    if (depth == unknown) depth = next;
  }
  notes.depth[r] = depth;
}

/// The part that a giant, now in part `source`, belongs to.
__device__ std::uint32_t target_of(const Notes& notes, const List& list, std::uint32_t source,
                                   std::uint32_t key) {
  const std::uint32_t last = list.parts() - 1;
  std::uint32_t target = 0;
  for (std::uint32_t r = 1; r <= last; ++r) target += notes.depth[r] <= key ? 1 : 0;
  // A short part has too few neighbours to exchange for giants that come.
  const bool is_short = list.length - notes.begin[last] < reorder_run / 2;
  return target == last && source != last && is_short ? last - 1 : target;
}

/// Notes the giants that are in the wrong part.
__device__ void find(const GiantParams& p, const List& list, Notes& notes) {
  constexpr std::uint32_t loads = 8;
  for (std::uint32_t first = 0; first < list.length; first += loads * block_size) {
    std::uint32_t slot[loads];
#pragma unroll
    for (std::uint32_t j = 0; j < loads; ++j)
      slot[j] = list.slot[min(first + j * block_size + threadIdx.x, list.length - 1)];
#pragma unroll
    for (std::uint32_t j = 0; j < loads; ++j) {
      const std::uint32_t at = first + j * block_size + threadIdx.x;
      if (at >= list.length || !may_be_giant(notes, slot[j])) continue;
      const std::uint32_t source = list.part_of(at);
      const std::uint32_t key = p.depth_key[slot[j]];
      if (key == 0 || target_of(notes, list, source, key) == source) continue;  // 0: hidden
      const std::uint32_t k = atomicAdd(&notes.found, 1u);
      if (k < most_found) notes.at[k] = at;
    }
  }
}

/// Run by one warp, a lane for each part. Finds how many neighbours must pass each boundary so that
/// all parts keep their lengths, and where each part's moves are noted.
__device__ void plan(Notes& notes) {
  const std::uint32_t r = threadIdx.x;
  const int taken = warp_sums(notes.gain[r]).before;  // from the part before
  const int gives = taken + notes.gain[r];
  const std::uint32_t leave = notes.leaving[r] + max(gives, 0) + max(-taken, 0);
  const WarpSums<std::uint32_t> leaving = warp_sums(leave);
  notes.gives[r] = gives;
  notes.next_left[r] = notes.next_taken[r] = leaving.before;
  if (r == 0) notes.moves = leaving.all;
}

/// Run by one warp. Notes the neighbours that pass the boundary behind part r. A part gives from
/// the half next to the boundary.
__device__ void give(const List& list, std::uint32_t r, Notes& notes) {
  const std::uint32_t lane = threadIdx.x % warp_size;
  const bool back = notes.gives[r] > 0;
  std::uint32_t lacks = static_cast<std::uint32_t>(abs(notes.gives[r]));
  const std::uint32_t giver = back ? r : r + 1, taker = back ? r + 1 : r;
  const std::uint32_t begin = notes.begin[giver], end = notes.begin[giver + 1];
  const std::uint32_t half = (end - begin) / 2;
  for (std::uint32_t first = 0; lacks > 0; first += warp_size) {
    if (first >= half) {
      notes.lacking = true;
      return;
    }
    const std::uint32_t at = back ? end - 1 - first - lane : begin + first + lane;
    const std::uint32_t slot = first + lane < half ? list.slot[at] : 0;
    const std::uint32_t able =
        __ballot_sync(~0u, first + lane < half && !may_be_giant(notes, slot));
    const std::uint32_t rank = __popc(able & ((1u << lane) - 1u));
    const std::uint32_t given = min(lacks, __popc(able));
    std::uint32_t left = 0, taken = 0;
    if (lane == 0) {
      left = atomicAdd(&notes.next_left[giver], given);
      taken = atomicAdd(&notes.next_taken[taker], given);
    }
    left = __shfl_sync(~0u, left, 0);
    taken = __shfl_sync(~0u, taken, 0);
    if ((able >> lane & 1u) != 0 && rank < given) {
      notes.left[left + rank] = at;
      notes.taken[taken + rank] = slot;
    }
    lacks -= given;
  }
}

/// Carries the giants that were found to the parts that their depths belong to. Returns false if
/// any was left.
__device__ bool carry(const GiantParams& p, const List& list, Notes& notes) {
  const std::uint32_t found = min(notes.found, most_found);
  std::uint32_t giant[found_per_thread], source[found_per_thread], target[found_per_thread];
#pragma unroll
  for (std::uint32_t j = 0; j < found_per_thread; ++j) {
    const std::uint32_t k = j * block_size + threadIdx.x;
    source[j] = target[j] = 0;
    if (k >= found) continue;
    giant[j] = list.slot[notes.at[k]];
    source[j] = list.part_of(notes.at[k]);
    target[j] = target_of(notes, list, source[j], p.depth_key[giant[j]]);
    atomicAdd(&notes.gain[target[j]], 1);
    atomicSub(&notes.gain[source[j]], 1);
    atomicAdd(&notes.leaving[source[j]], 1u);
  }
  __syncthreads();
  if (threadIdx.x < warp_size) plan(notes);
  __syncthreads();
  if (notes.moves > most_moves) return false;
#pragma unroll
  for (std::uint32_t j = 0; j < found_per_thread; ++j) {
    if (target[j] == source[j]) continue;
    notes.left[atomicAdd(&notes.next_left[source[j]], 1u)] = notes.at[j * block_size + threadIdx.x];
    notes.taken[atomicAdd(&notes.next_taken[target[j]], 1u)] = giant[j];
  }
  for (std::uint32_t r = threadIdx.x / warp_size; r + 1 < list.parts(); r += block_size / warp_size)
    give(list, r, notes);
  __syncthreads();
  if (notes.lacking) return false;
  for (std::uint32_t k = threadIdx.x; k < notes.moves; k += block_size)
    list.slot[notes.left[k]] = notes.taken[k];
  return notes.found <= most_found;
}

__global__ void __launch_bounds__(block_size) giants_kernel(const GiantParams p) {
  __shared__ Notes notes;
  let_next_kernel_begin();
  wait_for_earlier_work();
  const std::uint32_t giants = p.counts->giants;
  if (p.counts->unlisted != 0 || giants == 0) return;
  if (giants > most_giants) {
    p.counts->uncarried_lists = p.shape.tiles();
    return;
  }
  for (std::uint32_t i = threadIdx.x; i < giant_words; i += block_size) notes.bits[i] = p.bits[i];
  for (std::uint32_t t = blockIdx.x; t < p.shape.tiles(); t += gridDim.x) {
    const uint2 range = p.range[t];
    const List list{p.slot + range.x, range.y - range.x, p.ordered[t]};
    if (list.ordered == 0 || list.parts() < 2) continue;
    __syncthreads();
    if (threadIdx.x < warp_size) begin_parts(p, list, notes);
    __syncthreads();
    find(p, list, notes);
    __syncthreads();
    if (notes.found > 0 && !carry(p, list, notes) && threadIdx.x == 0)
      atomicAdd(&p.counts->uncarried_lists, 1u);
  }
}

}  // namespace

void launch_giants(const GiantParams& params, cudaStream_t stream) {
  constexpr int blocks_per_processor = 14;  // more than run at a time
  launch_early("giants", giants_kernel, params.processors * blocks_per_processor, block_size,
               stream, params);
}

}  // namespace catgs::cuda
