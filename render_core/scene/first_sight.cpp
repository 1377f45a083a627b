#include "render_core/scene/first_sight.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/scene/robust_bounds.h"

namespace catgs {

namespace {

/// Any unit vector at a right angle to `v`.
glm::vec3 perpendicular(const glm::vec3& v) {
  const glm::vec3 axis = std::abs(v.x) < 0.7f ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
  return glm::normalize(glm::cross(v, axis));
}

}  // namespace

Pose look_at(const glm::vec3& eye, const glm::vec3& target, const glm::vec3& up) {
  const glm::vec3 view = target - eye;
  const glm::vec3 forward = glm::dot(view, view) > 0.0f ? glm::normalize(view) : perpendicular(up);
  glm::vec3 right = glm::cross(forward, up);
  right = glm::length(right) > 1e-4f ? glm::normalize(right) : perpendicular(forward);
  const glm::vec3 down = glm::cross(forward, right);
  return {eye, glm::normalize(glm::quat_cast(glm::mat3(right, down, forward)))};
}

SceneHints estimate_hints(const GaussianCloud& cloud, const glm::vec3& up) {
  SceneHints hints;
  hints.up = up;
  hints.source = "estimated";
  const Bounds bounds = robust_bounds(cloud).value_or(Bounds{glm::vec3(-1), glm::vec3(1)});
  const float radius = std::max(0.5f * glm::distance(bounds.min, bounds.max), 1e-3f);
  hints.focus = 0.5f * (bounds.min + bounds.max);
  const glm::vec3 side = perpendicular(up), front = glm::cross(side, up);
  const glm::vec3 eye = hints.focus + radius * (1.6f * front + 0.4f * side + 0.5f * up);
  hints.start_pose = look_at(eye, hints.focus, up);
  hints.near_z = std::min(0.2f, 0.02f * radius);
  hints.limits = {bounds.min - 2.0f * radius, bounds.max + 2.0f * radius};
  return hints;
}

}  // namespace catgs
