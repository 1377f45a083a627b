#pragma once

#include <cmath>
#include <string>

#include <glm/ext/vector_double2.hpp>

#include "render_core/math/camera.h"

namespace catgs {

/// How a camera sees, for pictures of any size.
struct Lens {
  glm::ivec2 size_px{0};  // of its own picture; 0: not known
  // Tangents of half the angles of view in its own picture. 0: not known; pixels are square then.
  glm::dvec2 half_tan{0.0};
  glm::dvec2 centre{0.5};  // the principal point, as a share of its own picture
  std::string distortion;  // "OPENCV k1 0.1": what a pinhole camera leaves out; empty: nothing

  [[nodiscard]] bool known() const { return half_tan.x > 0.0 || half_tan.y > 0.0; }
  bool operator==(const Lens&) const = default;
};

/// The camera that draws a picture of `size_px` with a known lens. A picture of another shape keeps
/// the vertical angle, and shows more or less at both sides. A lens without a size of which only
/// the horizontal angle is known keeps that one.
inline Camera make_camera(const Lens& lens, glm::ivec2 size_px) {
  const glm::dvec2 size(size_px), tangents = lens.half_tan;
  glm::dvec2 own(lens.size_px);
  if (lens.size_px == glm::ivec2(0)) {
    own = size;
    if (tangents.x > 0.0 && tangents.y > 0.0) own.x = own.y * tangents.x / tangents.y;
  }
  glm::dvec2 focal = 0.5 * own / tangents;
  if (!(tangents.x > 0.0)) focal.x = focal.y;
  if (!(tangents.y > 0.0)) focal.y = focal.x;
  glm::dvec2 scale = size / own;
  // Sides of scaled pictures are rounded to whole pixels.
  if (std::abs(own.x * scale.y - size.x) > 1.0) scale.x = scale.y;
  Camera camera;
  camera.size_px = size_px;
  camera.focal_px = focal * scale;
  camera.principal_point_px = 0.5 * size + (lens.centre - 0.5) * own * scale;
  return camera;
}

}  // namespace catgs
