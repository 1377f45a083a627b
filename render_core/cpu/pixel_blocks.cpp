#include "render_core/cpu/pixel_blocks.h"

#include <cassert>
#include <numeric>

#include <glm/common.hpp>

#include "render_core/math/constants.h"
#include "render_core/math/homography-inl.h"

namespace catgs {

void widen_for_blocks(FramePlan& plan, GridKind grid) {
  // Distance from a block's middle to the centres of its pixels, in a picture that turns may
  // stretch by a fifth. A shift adds the distance from pixel centres to the edges of their tile.
  constexpr double half_block = 0.5 * (block_side_px - 1), stretch = 1.2;
  if (plan.window == 0) return;
  if (grid == GridKind::warp) plan.growth.constant += stretch * half_block;
  if (grid == GridKind::shift) plan.growth.constant += 0.5 + half_block;
}

void PixelBlocks::place(glm::ivec2 size_px, const FramePlan& plan) {
  assert(size_px.x > 0 && size_px.y > 0);
  const TileGrid& grid = plan.grid;
  const auto list_from_frame = math::convert<float>(plan.list_from_frame);
  const glm::vec2 first(grid.first_px), last(grid.tiles - 1);
  const glm::ivec2 count = (size_px + (block_side_px - 1)) / block_side_px;
  constexpr float middle = 0.5f * block_side_px;

  tiles_.clear();
  starts_.assign(
      static_cast<std::size_t>(grid.tiles.x) * static_cast<std::size_t>(grid.tiles.y) + 1, 0);
  for (int row = 0; row < count.y; ++row) {
    for (int column = 0; column < count.x; ++column) {
      const auto at =
          math::apply<float>(list_from_frame, {static_cast<float>(column * block_side_px) + middle,
                                               static_cast<float>(row * block_side_px) + middle});
      const glm::vec2 in_grid = (glm::vec2(at.x, at.y) - first) / static_cast<float>(tile_size_px);
      const glm::ivec2 tile(glm::clamp(in_grid, glm::vec2(0.0f), last));
      tiles_.push_back(static_cast<std::uint32_t>(tile.y * grid.tiles.x + tile.x));
      ++starts_[tiles_.back()];
    }
  }
  // A counting sort: positions start at the ends and count down to the beginnings.
  std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
  blocks_.resize(tiles_.size());
  for (std::size_t i = tiles_.size(); i-- > 0;) {
    const auto index = static_cast<int>(i);
    blocks_[--starts_[tiles_[i]]] = {static_cast<std::uint16_t>(index % count.x * block_side_px),
                                     static_cast<std::uint16_t>(index / count.x * block_side_px)};
  }
}

std::size_t PixelBlocks::memory_bytes() const {
  return blocks_.capacity() * sizeof(PixelBlock) +
         (starts_.capacity() + tiles_.capacity()) * sizeof(std::uint32_t);
}

}  // namespace catgs
