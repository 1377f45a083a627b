#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/cpu/kernels.h"
#include "render_core/motion/frame_groups.h"

namespace catgs {

/// Widens the lists of a plan so that they hold for whole blocks. A block uses the list of the tile
/// that its middle is in.
void widen_for_blocks(FramePlan& plan, GridKind grid);

/// The blocks of an image, grouped by the tile whose list they blend, each block once.
class PixelBlocks {
 public:
  /// Assigns each block to the tile of the plan's grid that holds list_from_frame(its middle), or
  /// to the nearest tile if the middle is just outside of the grid.
  void place(glm::ivec2 size_px, const FramePlan& plan);

  [[nodiscard]] std::span<const PixelBlock> of_tile(std::size_t tile) const {
    assert(tile + 1 < starts_.size());
    return {blocks_.data() + starts_[tile], blocks_.data() + starts_[tile + 1]};
  }
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  std::vector<PixelBlock> blocks_;
  std::vector<std::uint32_t> starts_;  // [tile], one more
  std::vector<std::uint32_t> tiles_;   // [block], row by row of the image
};

}  // namespace catgs
