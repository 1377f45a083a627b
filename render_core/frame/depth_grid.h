#pragma once

#include <span>

#include <glm/vec2.hpp>

namespace catgs {

/// How far what a picture shows is, in the cells of a regular grid over it. The depth of a pixel is
/// the view depth at which half of its light is stopped, and a cell has the median of its pixels.
/// Depths are inverse, 1 / world units: on the screen, things move by them when the camera moves.
struct DepthGrid {
  glm::ivec2 cells{0};                    // columns and rows; 0: nothing is known
  std::span<const float> inverse_depths;  // by rows from the top; 0: less than half is stopped
};

inline constexpr int max_depth_cells = 128;  // a side

}  // namespace catgs
