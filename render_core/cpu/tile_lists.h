#pragma once

#include <atomic>
#include <cassert>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/base/radix_sort.h"
#include "render_core/base/thread_pool.h"
#include "render_core/cpu/kernels.h"
#include "render_core/cpu/list_sort.h"

namespace catgs {

/// The splats of a frame: [rank * cluster_size + i], i < counts[rank]. This index is a splat's
/// slot. The ranks of the second eye, if there is one, follow those of the first, as its rows of
/// tiles do in the lists.
struct SplatTable {
  struct Second {
    std::size_t first_rank = std::numeric_limits<std::size_t>::max();
    int first_row = 0;  // of tiles
    DepthLimits limits{};
  };

  std::span<const Splat> splats;
  const SplatPath* paths;  // [slot]; null: ellipses are listed, not trails
  std::span<const std::uint32_t> counts;
  DepthLimits limits;
  Second second{};

  [[nodiscard]] ListTask of_cluster(std::size_t rank) const {
    const std::size_t first = rank * cluster_size;
    const bool is_second = rank >= second.first_rank;
    return {splats.subspan(first, counts[rank]), paths == nullptr ? nullptr : paths + first,
            static_cast<std::uint32_t>(first), is_second ? second.limits : limits,
            is_second ? second.first_row : 0};
  }
};

/// The lists of splats that the tiles blend. Listing decides which splats are in a list, and
/// sorting decides their order. Memory is kept from frame to frame and bounded: where more than
/// `max_entries` entries are needed, the farthest splats are left out of all lists, and their
/// entries are counted.
class TileLists {
 public:
  /// Starts lists for columns x rows of tiles: those of all eyes. Splats are added in `segments`
  /// shares, in parallel; each share belongs to one thread at a time.
  void begin(glm::ivec2 tiles, std::size_t segments, std::uint64_t max_entries);

  /// Lists splats for the tiles whose rectangle of pixel centres meets their ellipse alpha >=
  /// alpha_min, or their trail.
  void add(std::size_t segment, const ListTask& task, const SimdKernels& kernels);

  /// Builds the lists. Every splat of `table` must have been added once.
  void finish(const SplatTable& table, const SimdKernels& kernels, ThreadPool& pool);

  /// Brings each list into depth order; equal depths keep that of the clusters.
  void sort(std::span<const Splat> splats, ThreadPool& pool);

  /// Lists and sorts in the original's way: a (tile | depth) key per splat and tile of its box, one
  /// sort of all keys.
  void build_by_keys(const SplatTable& table, glm::ivec2 tiles, std::uint64_t max_entries,
                     ThreadPool& pool);

  [[nodiscard]] std::size_t tiles() const { return starts_.size() - 1; }
  /// The splats of a tile (row-major index): depth bits and slot.
  [[nodiscard]] std::span<const DepthSlot> list(std::size_t tile) const {
    assert(tile < tiles());
    return {entries_.data() + starts_[tile], entries_.data() + starts_[tile + 1]};
  }
  /// All tile indices, long lists first, because a long list started last would keep one thread
  /// busy while the others wait. Neighbours stay together among lists of similar length.
  [[nodiscard]] std::span<const std::uint32_t> tiles_by_length();

  [[nodiscard]] std::uint64_t entries() const { return starts_.back(); }
  [[nodiscard]] std::uint64_t overflowed_entries() const { return overflowed_; }
  [[nodiscard]] std::uint32_t longest() const;
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  struct Segment {
    std::vector<TileRun> runs;
    std::vector<std::uint32_t> positions;  // [tile]: length, then next position in its list
    std::uint64_t entries = 0;
  };
  /// Orders splats from near to far: depth bits, then slot.
  using DepthOrder = std::uint64_t;
  static constexpr DepthOrder nothing_left_out = ~DepthOrder{0};
  static DepthOrder depth_order(const DepthSlot& splat) {
    return DepthOrder{splat.key} << 32 | splat.value;
  }

  void clear_segments();
  void list_nearest(const SplatTable& table, const SimdKernels& kernels, ThreadPool& pool);
  DepthOrder find_first_left_out(const SplatTable& table, ThreadPool& pool);
  void place_lists();
  std::uint64_t count_keys(const SplatTable& table, ThreadPool& pool);

  int tiles_across_ = 0;
  std::uint64_t max_entries_ = 0;
  std::vector<Segment> segments_;
  std::atomic<std::uint64_t> runs_{0};
  DepthOrder first_left_out_ = nothing_left_out;
  std::vector<std::uint64_t> starts_ = {0};  // tiles + 1
  std::vector<DepthSlot> entries_;
  std::uint64_t overflowed_ = 0;
  std::vector<std::uint32_t> tiles_by_length_;
  // Used when memory is short.
  std::vector<std::uint32_t> entries_of_slot_;
  std::vector<DepthSlot> by_depth_, by_depth_scratch_;
  // For build_by_keys().
  std::vector<std::uint64_t> key_offsets_;  // [cluster rank]
  std::vector<CodedIndex> keys_, key_scratch_;
  RadixSorter sorter_;
};

}  // namespace catgs
