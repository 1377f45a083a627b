#pragma once

#include <optional>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/walk/walk_map.h"

namespace catgs::walk {

// A second implementation of the page's walker (web_client/src/walk). Golden files compare the two,
// and tests of maps walk with it.

/// The clear ground below a place of the world, where a person would come to stand.
std::optional<Stand> stand_below(const WalkMap& map, const glm::vec3& position);

/// The walker's eyes in the world.
glm::vec3 eyes_of(const WalkMap& map, const Stand& stand);

/// Returns where a walker ends that wants to move by `way` (east, north; cells). The body moves as
/// long as the ground under it is clear. Otherwise it slides: it takes the nearest free direction
/// up to 67.5 degrees aside, as far as `way` points in that direction.
Stand move(const WalkMap& map, const Stand& from, const glm::vec2& way);

/// Whether a walker gets from `from` to `to` on the straight line.
bool straight(const WalkMap& map, const Stand& from, const Stand& to);

/// A shortest way over the grid and its eight directions (A*, Hart, Nilsson and Raphael 1968), with
/// straight pieces between its turns. It begins with `from`. Empty where there is none. Takes 12
/// bytes for each place of the map.
std::vector<Stand> find_path(const WalkMap& map, const Stand& from, const Stand& to);

}  // namespace catgs::walk
