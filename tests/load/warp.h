#pragma once

#include <optional>

#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>

#include "render_core/image/image.h"
#include "render_core/math/camera.h"

namespace catgs::load {

// The warp of the page (web_client/src/present/warp.ts). tests/support/warp_golden.json holds both
// to the same numbers. Points are -1…1 across an image, y down.

/// A pinhole camera without a size.
struct Eye {
  Pose world_from_camera;
  float fov_y_rad = 1.0f;
};

/// Homography from points of the view to points of the picture. It is exact for the plane at
/// `distance` ahead of the view, or for the far field if that is infinite. Aspects are width over
/// height.
glm::dmat3 warp_matrix(const Eye& picture, const Eye& view, double picture_aspect,
                       double view_aspect, double distance);

/// Point of the picture of a point of the view; nothing behind the picture's camera.
std::optional<glm::dvec2> warped(const glm::dmat3& picture_from_view, const glm::dvec2& at);

/// How far the view reaches from the middle of the picture: 1 is the border, and 4 the most
/// returned.
glm::dvec2 reach(const glm::dmat3& picture_from_view);

/// Share of the view that the picture does not cover, sampled on a grid.
double uncovered_share(const glm::dmat3& picture_from_view);

/// Field of view whose image plane is `factor` times as large, limited to the range of the wire.
float widened_fov(float fov_y_rad, double factor);

/// Appends the picture's colour at a point: bilinear, and its border repeated outside of it.
void append_sample(const Image& picture, const glm::dvec2& at, Image& out);

/// The picture as the view sees it: bilinear, and its border repeated outside of it.
Image warp_image(const Image& picture, const glm::dmat3& picture_from_view, glm::ivec2 size_px);

}  // namespace catgs::load
