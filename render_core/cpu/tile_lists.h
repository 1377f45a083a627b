#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/radix_sort.h"
#include "render_core/thread_pool.h"

namespace catgs {

/// Which splats each tile blends, front to back. Memory is kept from frame to frame.
class TileLists {
 public:
  /// Lists each splat for the tiles whose rectangle of pixel centres meets its ellipse alpha >=
  /// alpha_min. `order`: visible splats front to back. Where the lists would outgrow `max_entries`,
  /// the longest ones lose their farthest splats.
  void build_exact(std::span<const Splat> splats, std::span<const DepthSlot> order, glm::ivec2 grid,
                   std::uint64_t max_entries, ThreadPool& pool);

  /// The original's way: a (tile | depth) key per splat and tile of its box, one sort of all keys.
  /// `visible`: splats in any order. Keys beyond `max_entries` are not made.
  void build_by_keys(std::span<const Splat> splats, std::span<const DepthSlot> visible,
                     glm::ivec2 grid, std::uint64_t max_entries, ThreadPool& pool);

  [[nodiscard]] std::size_t tiles() const { return starts_.size() - 1; }
  /// Slots of the splats of a tile (row-major index), front to back.
  [[nodiscard]] std::span<const std::uint32_t> list(std::size_t tile) const {
    return {entries_.data() + starts_[tile], entries_.data() + starts_[tile + 1]};
  }
  [[nodiscard]] std::uint64_t entries() const { return starts_.back(); }
  [[nodiscard]] std::uint64_t overflowed_entries() const { return overflowed_; }
  [[nodiscard]] std::uint32_t longest() const;

 private:
  std::uint64_t place_lists(std::size_t segments, std::uint64_t max_entries);

  std::vector<std::uint64_t> starts_ = {0};  // tiles + 1
  std::vector<std::uint32_t> entries_;
  std::uint64_t overflowed_ = 0;
  std::vector<std::uint32_t> positions_;  // [segment][tile]
  std::vector<std::uint64_t> key_offsets_;
  std::vector<CodedIndex> keys_, key_scratch_;
  RadixSorter sorter_;
};

/// Puts runs of equal keys into the order of the scene, as the reference has it.
void order_ties(std::span<const Splat> splats, std::span<DepthSlot> sorted);
void order_ties(std::span<const Splat> splats, std::span<CodedIndex> sorted);

}  // namespace catgs
