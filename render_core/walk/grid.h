#pragma once

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include "render_core/math/look_at.h"

namespace catgs::walk {

/// Cells of a grid per eye height. All sizes of a person are constants in cells for that reason.
inline constexpr float cells_per_eye_height = 16.0f;

/// A walking person: an upright cylinder. Lengths are shares of the eye height.
struct Person {
  float radius = 0.15f;
  float height = 1.08f;
  float step = 0.22f;   // the highest step up or down
  float slope = 1.2f;   // the steepest slope, its tangent
  float chest = 0.75f;  // what is lower is furniture, not a wall

  static constexpr float in_cells(float share) { return share * cells_per_eye_height; }
};

/// Cubic cells over a part of the world. Grid coordinates count cells along three axes at right
/// angles: east, north, up. Seen from above with north upwards, east points to the right.
struct Grid {
  glm::vec3 origin{0.0f};  // the world place of grid coordinates (0, 0, 0)
  glm::mat3 axes{1.0f};    // columns: east, north, up as unit vectors of the world
  float cell = 1.0f;       // world units

  [[nodiscard]] glm::vec3 from_world(const glm::vec3& position) const {
    return glm::transpose(axes) * (position - origin) / cell;
  }
  [[nodiscard]] glm::vec3 to_world(const glm::vec3& position) const {
    return origin + axes * position * cell;
  }
};

/// The most cells of a grid along each axis. The start lies in the middle.
inline constexpr int grid_side = 2048, grid_levels = 1024;

/// The grid around `start` for a person with this eye height (world units). East is the world's +x
/// as far as `up` (unit) allows.
inline Grid grid_around(const glm::vec3& start, const glm::vec3& up, float eye_height) {
  const glm::vec3 x(1, 0, 0), flat = x - glm::dot(x, up) * up;
  const glm::vec3 east = glm::length(flat) > 0.1f ? glm::normalize(flat) : perpendicular(up);
  Grid grid{start, glm::mat3(east, glm::cross(up, east), up), eye_height / cells_per_eye_height};
  grid.origin = grid.to_world(-0.5f * glm::vec3(grid_side, grid_side, grid_levels));
  return grid;
}

}  // namespace catgs::walk
