#include "render_core/walk/plan.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace catgs::walk {
namespace {

constexpr glm::vec3 unknown(0.78f, 0.81f, 0.85f), wall(0.16f, 0.18f, 0.22f),
    low(0.6f, 0.57f, 0.52f), red(0.85f, 0.15f, 0.1f);

/// How steep the ground at a place is, towards east and north.
float steepness(const WalkMap& map, const glm::ivec2& column, float height) {
  glm::vec2 rise(0.0f);
  for (int axis = 0; axis < 2; ++axis) {
    const glm::ivec2 beside = column + (axis == 0 ? glm::ivec2(1, 0) : glm::ivec2(0, 1));
    if (const Position* position = map.clear_at(beside, height))
      rise[axis] = position->cells() - height;
  }
  return glm::length(rise);
}

/// Higher places cover lower ones, and obstacles cover ground.
glm::vec3 colour_of(const WalkMap& map, std::size_t storey, const glm::ivec2& column) {
  glm::vec3 colour = unknown;
  for (const Position& position : map.at(column)) {
    if (map.storey_at(position.cells()) != storey) continue;
    switch (position.kind) {
      case Kind::clear:
        colour = glm::vec3(1.0f - 0.3f * std::min(steepness(map, column, position.cells()), 1.0f));
        break;
      case Kind::near:
        colour = glm::vec3(0.92f);
        break;
      case Kind::low:
        colour = low;
        break;
      case Kind::obstacle:
        colour = wall;
        break;
    }
  }
  return colour;
}

}  // namespace

Image draw_plan(const WalkMap& map, std::size_t storey) {
  constexpr int most_px = 1024;
  const int side = std::max(1, most_px / std::max(map.size.x, map.size.y));
  Image image{map.size * side, {}};
  image.rgb.reserve(static_cast<std::size_t>(image.size_px.x) *
                    static_cast<std::size_t>(image.size_px.y) * 3);
  const bool has_start = map.storey_at(map.start.height) == storey;
  for (int y = 0; y < image.size_px.y; ++y)
    for (int x = 0; x < image.size_px.x; ++x) {
      const glm::ivec2 column(x / side, map.size.y - 1 - y / side);
      const bool starts = has_start && glm::distance(glm::vec2(column) + 0.5f, map.start.position) <
                                           Person::in_cells(map.person.radius);
      const glm::vec3 colour = starts ? red : colour_of(map, storey, column);
      image.rgb.insert(image.rgb.end(), {colour.r, colour.g, colour.b});
    }
  return image;
}

std::string north_of(const Grid& grid) {
  const glm::vec3& north = grid.axes[1];
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (std::abs(north[k]) > std::abs(north[axis])) axis = k;
  return {north[axis] < 0.0f ? '-' : '+', "xyz"[axis]};
}

}  // namespace catgs::walk
