#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/walk/grid.h"

namespace catgs::walk {

/// The contents of a column at a height.
enum class Kind : std::uint8_t {
  clear,    // ground for a person's axis: the whole body has room
  near,     // ground, but less than a body's radius from an edge or an obstacle
  low,      // an obstacle that ends below the chest, on this ground
  obstacle  // one that reaches the chest: a wall
};

/// A height of a column.
struct Position {
  static constexpr float per_cell = 16.0f;
  std::uint16_t height;  // cells * per_cell
  Kind kind;

  [[nodiscard]] float cells() const { return static_cast<float>(height) / per_cell; }
  bool operator==(const Position&) const = default;
};

/// A floor of a building, or all of a terrain: the places from `low` up to the next storey's.
struct Storey {
  float low = 0.0f;        // cells
  float level = 0.0f;      // cells; the height of most of its ground
  std::uint32_t area = 0;  // clear cells
};

/// Where a walker stands.
struct Stand {
  glm::vec2 position{0.0f};  // east, north; cells
  float height = 0.0f;       // of the ground, cells
};

/// The ground that a person reaches on foot from a start, in cells of a grid, and the obstacles
/// around it. Places of a column are sorted by height. Two places that are ground are more than a
/// step apart, and so the neighbour of a place is unique.
struct WalkMap {
  Grid grid;  // about `origin`
  Person person;
  Stand start;
  glm::ivec2 size{0};                // columns
  std::vector<std::uint32_t> first;  // size.x * size.y + 1 indices in `positions`, row by row
  std::vector<Position> positions;
  std::vector<Storey> storeys;  // from below
  glm::dvec3 origin{0.0};       // of the scene: see scene_origin.h

  [[nodiscard]] bool holds(const glm::ivec2& column) const {
    return column.x >= 0 && column.y >= 0 && column.x < size.x && column.y < size.y;
  }
  /// The places of a column of the map.
  [[nodiscard]] std::span<const Position> at(const glm::ivec2& column) const {
    const auto i = static_cast<std::size_t>(column.y) * static_cast<std::size_t>(size.x) +
                   static_cast<std::size_t>(column.x);
    return std::span(positions).subspan(first[i], first[i + 1] - first[i]);
  }
  /// The clear ground of a column within a step of `height` (cells), if there is some.
  [[nodiscard]] const Position* clear_at(const glm::ivec2& column, float height) const;
  /// The index in `storeys` of a height.
  [[nodiscard]] std::size_t storey_at(float height) const;
};

}  // namespace catgs::walk
