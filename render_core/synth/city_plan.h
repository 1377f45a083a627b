#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/synth/shadows.h"

namespace catgs::synth {

// The city is an endless plan: a grid of blocks between streets. Each block is a pure function of
// (seed, column, row). City coordinates are metres: x and z on the ground, heights upward.

struct Rect {
  glm::vec2 min;  // x, z
  glm::vec2 max;
  [[nodiscard]] glm::vec2 size() const { return max - min; }
  [[nodiscard]] glm::vec2 middle() const { return (min + max) * 0.5f; }
};

enum class Roof { mansard, hip, spire, terrace, tower };
enum class Style { stucco, stone, brick, curtain };  // curtain: a glass front

/// Sides of a rectangle, in the order of the arrays below: -x, +x, -z, +z.
enum class Side { west, east, south, north };
enum class SideUse { street, court, party };  // party: shared with a neighbour

struct Building {
  std::uint64_t key;
  Rect base;
  int floors;  // above the ground floor
  float ground_height;
  float floor_height;
  Roof roof;
  Style style;
  std::array<SideUse, 4> sides;
  std::array<float, 4> neighbour_eaves;  // height that hides the lower part of a party wall
  [[nodiscard]] float eaves() const {
    return ground_height + static_cast<float>(floors) * floor_height;
  }
  [[nodiscard]] float roof_height() const;
};

struct Tree {
  std::uint64_t key;
  glm::vec2 position;
  float height;
  float crown;  // radius
};

struct Car {
  std::uint64_t key;
  glm::vec2 position;
  bool along_x;
  bool forward;  // towards +x or +z
};

struct Lamp {
  glm::vec2 position;
  glm::vec2 arm;  // unit, over the road
};

enum class BlockUse { houses, park, square, towers };

struct Block {
  int column;
  int row;
  std::uint64_t key;
  BlockUse use;
  Rect lot;  // between the pavements
  std::vector<Building> buildings;
  std::vector<Tree> trees;
  std::vector<Car> cars;
  std::vector<Lamp> lamps;
};

inline constexpr float block_pitch_m = 84.0f;
inline constexpr float house_depth_m = 12.5f;  // of the row of houses around a court
inline constexpr float pond_share = 0.42f;     // of half a park's width

/// The city grows around this place on the avenue at x = 0, beyond its first crossing at z = 0.
inline constexpr glm::vec2 city_centre(-6.0f, 44.0f);
inline constexpr glm::vec2 start_position(2.0f, -16.0f);  // of the first view

/// Density of Gaussians here relative to the part of the avenue where a visit starts. It follows
/// the number of pixels that a square metre covers from there, down to a minimum that still shows
/// windows.
float detail_at(const glm::vec2& position);

/// Distance between the building lines of the street at x = 84 column (or z = 84 row).
float street_width_x(int column);
float street_width_z(int row);
/// Width of the pavement on either side of it.
float pavement_width(float street_width);

/// The block between streets (column, row) and (column + 1, row + 1), with the trees, cars and
/// lamps of the streets to its west and south.
Block plan_block(std::uint64_t seed, int column, int row);

/// Adds the objects of a block that cast shadows.
void add_shadows(const Block& block, Shadows& shadows);

}  // namespace catgs::synth
