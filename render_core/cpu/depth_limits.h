#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>

#include "render_core/math/constants.h"

namespace catgs {

/// Side of the parts of a picture whose ends are kept. Ends of 8x8 px hide a sixth less of the demo
/// city at 640x360.
inline constexpr int part_side_px = 4;
inline constexpr int parts_across = tile_size_px / part_side_px;  // a tile

/// The depths behind which nothing of a picture shows, as a pyramid. Level 0 has a limit for each
/// part. A cell of the next level is the largest of 2x2. All levels have the same room. Three more
/// pyramids hold the largest of a cell and its neighbours, so that a box needs few loads.
struct DepthLimits {
  enum Spread { none = 0, right = 1, below = 2, both = right | below };
  static constexpr int spreads = both + 1;

  const float* cells = nullptr;  // [spread][level][row][column]; null: nothing is hidden
  int columns = 0, rows = 0;     // of a level: parts of the picture's tiles
  int levels = 0;

  static constexpr int tile_level = std::bit_width(static_cast<unsigned>(parts_across)) - 1;

  explicit operator bool() const { return cells != nullptr; }
  [[nodiscard]] float at(int level, int x, int y) const {
    return cells[(level * rows + y) * columns + x];
  }
  [[nodiscard]] float of_tile(int x, int y) const { return at(tile_level, x, y); }
};

/// A number for each part of one tile, parts_across in a row, rows `stride` apart: the view depth
/// where the part ends, or the inverse depth that it shows.
struct PartEnds {
  float* first = nullptr;  // null: not wanted
  int stride = 0;
};

}  // namespace catgs
