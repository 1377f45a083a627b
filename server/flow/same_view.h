#pragma once

#include <algorithm>
#include <cmath>

#include <glm/gtc/quaternion.hpp>

#include "server/net/messages.h"

namespace catgs {

/// True if two poses show the same picture. The tolerance is a hundredth of a pixel at a focal
/// length of 1000 px: by rotation, or by translation next to an object at the near plane.
inline bool same_view(const PoseSample& a, const PoseSample& b, float near_z) {
  constexpr float tolerance = 1.0e-5f;
  const Pose& p = a.world_from_camera;
  const Pose& q = b.world_from_camera;
  // For unit quaternions |qa - ±qb| is half the angle between them.
  const glm::quat delta = p.orientation - q.orientation;
  const glm::quat sum = p.orientation + q.orientation;
  const float half_angle = std::min(glm::length(delta), glm::length(sum));
  if (std::abs(a.view_height - b.view_height) > tolerance * a.view_height) return false;
  return 2.0f * half_angle <= tolerance && std::abs(a.fov_y_rad - b.fov_y_rad) <= tolerance &&
         glm::length(p.position - q.position) <= tolerance * near_z;
}

}  // namespace catgs
