#include "render_core/cpu/pixel_blocks.h"

#include <glm/common.hpp>

#include "render_core/math/constants.h"

namespace catgs {

void PixelBlocks::place(glm::ivec2 size_px) {
  blocks_.clear();
  starts_.assign(1, 0);
  for (int tile_y = 0; tile_y < size_px.y; tile_y += tile_size_px) {
    for (int tile_x = 0; tile_x < size_px.x; tile_x += tile_size_px) {
      const glm::ivec2 end = glm::min(glm::ivec2(tile_x, tile_y) + tile_size_px, size_px);
      for (int y = tile_y; y < end.y; y += block_side_px)
        for (int x = tile_x; x < end.x; x += block_side_px)
          blocks_.push_back({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)});
      starts_.push_back(static_cast<std::uint32_t>(blocks_.size()));
    }
  }
}

}  // namespace catgs
