#pragma once

#include <cstddef>
#include <string>

#include "render_core/image/image.h"
#include "render_core/walk/walk_map.h"

namespace catgs::walk {

/// The floor plan of a storey, north at the top. Walls are dark, furniture is grey. Ground is
/// white where the body has room, and a little darker near edges and on slopes. What is not known
/// is blue-grey, and the start is red. A cell is a square of pixels, so that the longer side has at
/// most 1,024 pixels, or a pixel where the map has more cells.
Image draw_plan(const WalkMap& map, std::size_t storey);

/// The axis of the world nearest to north, like "+z".
std::string north_of(const Grid& grid);

}  // namespace catgs::walk
