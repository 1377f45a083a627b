#pragma once

#include <glm/vec2.hpp>
#include <vector_types.h>

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/motion/frame_groups.h"

namespace catgs::cuda {

// Where the pictures of a group lie in its grid of tiles. With TileGrid::follows, the grid holds
// the pictures from the key frame to the window's end, and a margin; otherwise just the picture.

/// Sets picture, grid and tiles of a key frame. `margin_px`: of a grid with a window, on each side.
void set_grid(FrameShape& shape, glm::ivec2 size_px, const FramePlan& plan, int tile_side,
              int margin_px);

/// `shape` with as many tiles as the grid of any window of its picture may have.
FrameShape with_largest_grid(FrameShape shape);

/// The corner of a sub-frame's picture in the grid whose key frame has its corner at `key_px`.
inline glm::ivec2 corner_px(glm::ivec2 key_px, const FramePlan& plan) {
  return key_px - plan.shift_px;
}

/// The box around all pictures of a group, with margins, px: low x, low y, high x, high y.
int4 box_of_pictures(const FrameShape& key, const FramePlan& plan, int margin_px);

}  // namespace catgs::cuda
