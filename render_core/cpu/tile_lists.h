#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/radix_sort.h"
#include "render_core/thread_pool.h"

namespace catgs {

/// Which splats each tile blends. Filling decides membership, sorting the order. Memory is kept
/// from frame to frame.
class TileLists {
 public:
  /// Lists each visible splat for the tiles whose rectangle of pixel centres meets its ellipse
  /// alpha >= alpha_min. The splats of cluster rank r are splats[r * cluster_size + 0…counts[r]).
  /// Entries beyond `max_entries` are left out of the longest lists and counted.
  void fill(std::span<const Splat> splats, std::span<const std::uint32_t> counts, glm::ivec2 grid,
            std::uint64_t max_entries, const SimdKernels& kernels, ThreadPool& pool);

  /// Brings each list into depth order; equal depths keep the order of the scene.
  void sort(std::span<const Splat> splats, ThreadPool& pool);

  /// Both at once in the original's way: a (tile | depth) key per splat and tile of its box, one
  /// sort of all keys. Keys beyond `max_entries` are not made, and counted.
  void build_by_keys(std::span<const Splat> splats, std::span<const std::uint32_t> counts,
                     glm::ivec2 grid, std::uint64_t max_entries, ThreadPool& pool);

  [[nodiscard]] std::size_t tiles() const { return starts_.size() - 1; }
  /// The splats of a tile (row-major index): depth bits and slot.
  [[nodiscard]] std::span<const DepthSlot> list(std::size_t tile) const {
    return {entries_.data() + starts_[tile], entries_.data() + starts_[tile + 1]};
  }
  [[nodiscard]] std::uint64_t entries() const { return starts_.back(); }
  [[nodiscard]] std::uint64_t overflowed_entries() const { return overflowed_; }
  [[nodiscard]] std::uint32_t longest() const;

 private:
  /// A share of the splats that one thread lists at a time.
  struct Segment {
    std::vector<TileRun> runs;
    std::vector<std::uint32_t> positions;  // [tile]: entries, then next position in its list
  };
  std::uint64_t place_lists(std::size_t segments, std::uint64_t max_entries);

  std::vector<std::uint64_t> starts_ = {0};  // tiles + 1
  std::vector<DepthSlot> entries_;
  std::uint64_t overflowed_ = 0;
  std::vector<Segment> segments_;
  // build_by_keys()
  std::vector<std::uint64_t> key_offsets_;  // [cluster rank]
  std::vector<CodedIndex> keys_, key_scratch_;
  RadixSorter sorter_;
};

}  // namespace catgs
