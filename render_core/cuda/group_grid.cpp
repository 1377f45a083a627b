#include "render_core/cuda/group_grid.h"

#include <glm/common.hpp>
#include <vector_functions.h>

namespace catgs::cuda {
namespace {

glm::ivec2 tiles_of(glm::ivec2 size_px, int tile_side) {
  return (size_px + (tile_side - 1)) / tile_side;
}

}  // namespace

void set_grid(FrameShape& shape, glm::ivec2 size_px, const FramePlan& plan, int tile_side,
              int margin_px) {
  const glm::ivec2 margin(plan.window > 0 ? margin_px : 0);
  const glm::ivec2 grid = size_px + glm::abs(plan.end_shift_px) + 2 * margin;
  // Pictures move against the way of what they show.
  const glm::ivec2 corner = margin + glm::max(plan.end_shift_px, glm::ivec2(0));
  const glm::ivec2 tiles = tiles_of(grid, tile_side);
  shape.width_px = size_px.x;
  shape.height_px = size_px.y;
  shape.left_px = corner.x;
  shape.top_px = corner.y;
  shape.grid_width_px = grid.x;
  shape.grid_height_px = grid.y;
  shape.tiles_x = tiles.x;
  shape.tiles_y = tiles.y;
}

FrameShape with_largest_grid(FrameShape shape) {
  const glm::ivec2 size(shape.width_px, shape.height_px);
  const glm::ivec2 tiles = tiles_of(size + most_travel_px + 2 * grid_margin_px, tile_side_px);
  shape.tiles_x = tiles.x;
  shape.tiles_y = tiles.y;
  return shape;
}

int4 box_of_pictures(const FrameShape& key, const FramePlan& plan, int margin_px) {
  const glm::ivec2 first(key.left_px, key.top_px), last = first - plan.end_shift_px;
  const glm::ivec2 low = glm::min(first, last) - margin_px;
  const glm::ivec2 high =
      glm::max(first, last) + glm::ivec2(key.width_px, key.height_px) + margin_px;
  return make_int4(low.x, low.y, high.x, high.y);
}

}  // namespace catgs::cuda
