#pragma once

#include <cmath>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace catgs {

/// Rotation vector (axis times angle, radians) of the shorter rotation from `from` to `to`, in the
/// axes of `from`.
inline glm::dvec3 rotation_between(const glm::quat& from, const glm::quat& to) {
  glm::dquat turn = glm::conjugate(glm::dquat(from)) * glm::dquat(to);
  if (turn.w < 0.0) turn = -turn;
  const glm::dvec3 axis(turn.x, turn.y, turn.z);
  const double sine = glm::length(axis);
  return sine > 0.0 ? axis * (2.0 * std::atan2(sine, turn.w) / sine) : glm::dvec3(0.0);
}

/// `from`, turned by a rotation vector in its own axes.
inline glm::quat rotated(const glm::quat& from, const glm::dvec3& rotation) {
  const double angle = glm::length(rotation);
  if (!(angle > 0.0)) return from;
  return glm::quat(glm::normalize(glm::dquat(from) * glm::angleAxis(angle, rotation / angle)));
}

}  // namespace catgs
