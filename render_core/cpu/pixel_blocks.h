#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/cpu/kernels.h"

namespace catgs {

/// The blocks of an image by the tile whose list they blend, every block once.
class PixelBlocks {
 public:
  /// Blocks belong to the tile that they lie in.
  void place(glm::ivec2 size_px);

  [[nodiscard]] std::span<const PixelBlock> of_tile(std::size_t tile) const {
    return {blocks_.data() + starts_[tile], blocks_.data() + starts_[tile + 1]};
  }
  [[nodiscard]] std::size_t memory_bytes() const {
    return blocks_.capacity() * sizeof(PixelBlock) + starts_.capacity() * sizeof(std::uint32_t);
  }

 private:
  std::vector<PixelBlock> blocks_;
  std::vector<std::uint32_t> starts_;  // [tile], one more
};

}  // namespace catgs
