#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "render_core/motion/frame_groups.h"

namespace catgs {

/// How deep the pixels of each tile looked into its list in the last frame. Most of a list is
/// hidden behind opaque surfaces and needs no order. The reach is a guess: where pixels look
/// farther, the rest of the list is then sorted.
class TileReach {
 public:
  static constexpr std::uint32_t unknown = ~0u;

  /// Starts a frame. The tiles of a key frame take their reach from the tiles that showed the same
  /// part of the picture, or its neighbourhood.
  void begin(const FramePlan& plan);
  void forget() { last_.clear(); }

  /// Bits of a depth with some reserve, or `unknown`. It is constant within a group, so that few
  /// entries of a list enter the sorted part.
  [[nodiscard]] std::uint32_t of_tile(std::size_t tile) const {
    assert(tile < reach_.size());
    return reach_[tile];
  }
  /// Notes how far the pixels of a tile looked: up to an entry with this depth (bits), or `unknown`
  /// if they would have gone on. Tiles without pixels keep their reach.
  void set(std::size_t tile, std::uint32_t depth_bits);

  [[nodiscard]] std::size_t memory_bytes() const {
    return (reach_.capacity() + last_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  [[nodiscard]] std::uint32_t last_around(glm::ivec2 tile) const;

  FramePlan plan_;                           // of the last frame
  std::vector<std::uint32_t> reach_, last_;  // [tile]: for this group; of the last frame
};

}  // namespace catgs
