#pragma once

#include <array>
#include <cmath>

#include <glm/vector_relational.hpp>

#include "render_core/math/camera.h"

namespace catgs {

/// An eye of a head. It looks along the head's view axis, from beside the head's position.
struct Eye {
  glm::vec2 offset{0.0f};  // from the head along the camera's x and y axes, world units
  // Tangents of the angles from the view axis to the sides of the eye's picture: left and up, right
  // and down. Right and down are positive.
  glm::vec2 low{-1.0f}, high{1.0f};

  bool operator==(const Eye&) const = default;
};

inline constexpr float max_eye_tangent = 10.0f;  // of both signs
inline constexpr float least_eye_span = 1e-3f;   // from side to side

/// The left eye and the right one. Their pictures lie side by side, and have the same size.
using Stereo = std::array<Eye, 2>;

/// Whether what an eye sees is in range.
inline bool is_valid(const Eye& eye) {
  const auto finite = [](const glm::vec2& v) { return std::isfinite(v.x) && std::isfinite(v.y); };
  const auto bounded = [&](const glm::vec2& v, float most) {
    return finite(v) && glm::all(glm::lessThanEqual(glm::abs(v), glm::vec2(most)));
  };
  return bounded(eye.offset, max_coordinate) && bounded(eye.low, max_eye_tangent) &&
         bounded(eye.high, max_eye_tangent) &&
         glm::all(glm::greaterThanEqual(eye.high - eye.low, glm::vec2(least_eye_span)));
}

/// The camera of an eye. `head`: at the pose of the head, with the size of both pictures together.
/// Its near plane and its clip box are those of the eye, its lens says nothing.
///
/// A side whose tangent is t is drawn at focal t + principal px, so a picture `size` wide has
/// focal = size / (high - low) and principal = -focal low.
inline Camera eye_camera(const Camera& head, const Eye& eye) {
  Camera camera = head;
  Pose& pose = camera.world_from_camera;
  pose.position += glm::normalize(pose.orientation) * glm::vec3(eye.offset, 0.0f);
  camera.size_px.x /= 2;
  camera.focal_px = glm::vec2(camera.size_px) / (eye.high - eye.low);
  camera.principal_point_px = -camera.focal_px * eye.low;
  return camera;
}

/// The eyes of a head with `distance` (world units) between them. Each sees as much as `lens` does,
/// a camera with a size and without a pose.
inline Stereo eyes_like(const Camera& lens, float distance) {
  const glm::vec2 low = -lens.principal_point_px / lens.focal_px;
  const glm::vec2 high = low + glm::vec2(lens.size_px) / lens.focal_px;
  const glm::vec2 right(0.5f * distance, 0.0f);
  return {Eye{-right, low, high}, Eye{right, low, high}};
}

}  // namespace catgs
