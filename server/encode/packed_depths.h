#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/frame/depth_grid.h"

namespace catgs {

/// A depth grid as frames carry it. A cell's code c, 8 bit, stands for the inverse depth scale c^2:
/// steps are small where things are far, and everything moves by its inverse depth. Codes are sent
/// as what the median edge detector of JPEG-LS (ITU-T T.87, A.4.2) leaves of them, deflated.
struct PackedDepths {
  glm::ivec2 cells{0};
  float scale = 0.0f;  // 1 / world units
  std::vector<std::byte> codes;
};

/// The depths of an eye take at most this in a frame, with the cells of depth_cells_of(), in
/// captured rooms and cities.
inline constexpr int depth_bits = 9'000;

/// Cells for pictures of this size: about 64x36 of them, and about square. With several eyes side
/// by side, each has so many.
glm::ivec2 depth_cells_of(glm::ivec2 size_px, int eyes = 1);

/// Packs a grid that has cells. Inverse depths are finite and not negative.
PackedDepths pack(const DepthGrid& grid);

/// The code that the neighbours before a cell let expect. `codes`: by rows; those before it count.
int expected_code(std::span<const std::uint8_t> codes, int columns, int x, int y);

}  // namespace catgs
