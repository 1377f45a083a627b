#pragma once

#include <algorithm>
#include <limits>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace catgs {

/// The part of the world that is drawn: Gaussians whose centre c has low <= dot(axis, c) <= high on
/// all three axes. An axis of 0 leaves out none.
struct ClipBox {
  glm::mat3 axes{0.0f};  // columns, of any length
  // World units, times the lengths of the axes.
  glm::vec3 low{-std::numeric_limits<float>::infinity()};
  glm::vec3 high{std::numeric_limits<float>::infinity()};

  bool operator==(const ClipBox&) const = default;
};

/// A box with one side: leaves out what has dot(normal, c) > offset.
inline ClipBox clip_plane(const glm::vec3& normal, float offset) {
  ClipBox box;
  box.axes[0] = normal;
  box.high[0] = offset;
  return box;
}

/// A box around `centre` (world) whose sides are 2 half_extent long and turned by a rotation.
inline ClipBox oriented_box(const glm::vec3& centre, const glm::quat& world_from_box,
                            const glm::vec3& half_extent) {
  const glm::mat3 axes = glm::mat3_cast(world_from_box);
  const glm::vec3 middle = centre * axes;
  return {axes, middle - half_extent, middle + half_extent};
}

/// Distances along a ray, begin >= 0. Nowhere where begin > end.
struct RayPart {
  float begin, end;
};

/// The part of a ray that a box leaves in. `direction`: unit.
inline RayPart kept_part(const ClipBox& box, const glm::vec3& origin, const glm::vec3& direction) {
  RayPart part{0.0f, std::numeric_limits<float>::infinity()};
  for (int i = 0; i < 3; ++i) {
    const float at = glm::dot(box.axes[i], origin), step = glm::dot(box.axes[i], direction);
    const float low = box.low[i] - at, high = box.high[i] - at;
    if (step == 0.0f) {
      if (low > 0.0f || high < 0.0f) part.end = -1.0f;
      continue;
    }
    part.begin = std::max(part.begin, std::min(low / step, high / step));
    part.end = std::min(part.end, std::max(low / step, high / step));
  }
  return part;
}

}  // namespace catgs
