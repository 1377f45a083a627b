#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/cpu/kernels.h"
#include "render_core/motion/frame_groups.h"

namespace catgs {

/// Makes the lists of a plan hold for whole blocks, which go to the tile of their middle.
void widen_for_blocks(FramePlan& plan, GridKind grid);

/// The blocks of an image by the tile whose list they blend, every block once.
class PixelBlocks {
 public:
  /// Blocks belong to the tile of the plan's grid that holds list_from_frame(their middle); those
  /// that are just outside of the grid, to the nearest.
  void place(glm::ivec2 size_px, const FramePlan& plan);

  [[nodiscard]] std::span<const PixelBlock> of_tile(std::size_t tile) const {
    return {blocks_.data() + starts_[tile], blocks_.data() + starts_[tile + 1]};
  }
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  std::vector<PixelBlock> blocks_;
  std::vector<std::uint32_t> starts_;  // [tile], one more
  std::vector<std::uint32_t> tiles_;   // [block], row by row of the image
};

}  // namespace catgs
