#pragma once

#include <cmath>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/math/camera.h"

namespace catgs {

/// Any unit vector at a right angle to `v`.
inline glm::vec3 perpendicular(const glm::vec3& v) {
  const glm::vec3 axis = std::abs(v.x) < 0.7f ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
  return glm::normalize(glm::cross(v, axis));
}

/// A box that stands upright: its axes are level, level and `up` (unit, world axes). The first is
/// the world's x axis, or the z axis where x is nearly up, without its part along up.
inline glm::quat upright(const glm::vec3& up) {
  const glm::vec3 axis = std::abs(up.x) < 0.9f ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
  const glm::vec3 x = glm::normalize(axis - glm::dot(axis, up) * up);
  return glm::normalize(glm::quat_cast(glm::mat3(x, glm::cross(up, x), up)));
}

/// Orientation of a camera at `eye` that looks at `target` with `up` (unit, world axes) upright in
/// the image. Any orientation around the view axis is taken where the two are parallel.
inline Pose look_at(const glm::vec3& eye, const glm::vec3& target, const glm::vec3& up) {
  const glm::vec3 view = target - eye;
  const glm::vec3 forward = glm::dot(view, view) > 0.0f ? glm::normalize(view) : perpendicular(up);
  glm::vec3 right = glm::cross(forward, up);
  right = glm::length(right) > 1e-4f ? glm::normalize(right) : perpendicular(forward);
  const glm::vec3 down = glm::cross(forward, right);
  return {eye, glm::normalize(glm::quat_cast(glm::mat3(right, down, forward)))};
}

}  // namespace catgs
