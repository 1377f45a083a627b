#pragma once

#include <cmath>

#include <glm/ext/quaternion_float.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/math/clip_box.h"

namespace catgs {

/// Largest coordinate of a place in a scene, on each axis. Squares of larger ones would exceed a
/// float's precision.
inline constexpr float max_coordinate = 1.0e9f;

/// Camera-to-world rigid transform. Camera axes: x right, y down, z forward. World units are the
/// scene's. `orientation` is a unit quaternion that rotates camera axes into the world.
struct Pose {
  glm::vec3 position{0.0f};
  glm::quat orientation{1.0f, 0.0f, 0.0f, 0.0f};  // glm's constructor order: w, x, y, z
};

/// Where the part of a picture that a camera draws lies in the whole.
struct Crop {
  glm::ivec2 from_px{0};   // its upper left corner
  glm::ivec2 whole_px{0};  // size of the whole picture; 0: the camera draws all of it

  bool operator==(const Crop&) const = default;
};

/// A camera at a pose. Its rays meet in the pose's position, or are parallel. Pixel centres lie at
/// integer + 0.5.
struct Camera {
  Pose world_from_camera;
  glm::ivec2 size_px{0};
  glm::vec2 focal_px{0.0f};  // orthographic: pixels per world unit
  glm::vec2 principal_point_px{0.0f};
  float near_z = 0.2f;  // world units along the view axis; Gaussians nearer than this are dropped
  ClipBox clip{};
  Crop crop{};  // the projection is clamped as in the whole picture, so that parts fit together
  bool orthographic = false;  // rays are parallel to the view axis
};

/// Whether both draw the same where they are at the same pose.
inline bool same_lens(const Camera& a, const Camera& b) {
  return a.size_px == b.size_px && a.focal_px == b.focal_px &&
         a.principal_point_px == b.principal_point_px && a.near_z == b.near_z && a.clip == b.clip &&
         a.crop == b.crop && a.orthographic == b.orthographic;
}

/// Camera with square pixels and the principal point in the middle of the image.
inline Camera make_camera(const Pose& world_from_camera, glm::ivec2 size_px, float focal_px,
                          float near_z = 0.2f) {
  return {world_from_camera, size_px, glm::vec2(focal_px), glm::vec2(size_px) * 0.5f, near_z};
}

/// Camera with parallel rays whose picture is `view_height` world units high.
inline Camera make_orthographic_camera(const Pose& world_from_camera, glm::ivec2 size_px,
                                       float view_height, float near_z = 0.2f) {
  const float px_per_unit = static_cast<float>(size_px.y) / view_height;
  Camera camera = make_camera(world_from_camera, size_px, px_per_unit, near_z);
  camera.orthographic = true;
  return camera;
}

/// Where a camera sees colours from: an orthographic one from so far behind that all directions are
/// its view axis, to 1e-7.
inline glm::vec3 colour_eye(const Camera& camera) {
  const Pose& pose = camera.world_from_camera;
  if (!camera.orthographic) return pose.position;
  return pose.position - pose.orientation * glm::vec3(0.0f, 0.0f, max_coordinate);
}

/// The camera that draws a part of the picture of `whole`, which is no part itself.
inline Camera cropped(const Camera& whole, glm::ivec2 from_px, glm::ivec2 size_px) {
  Camera part = whole;
  part.size_px = size_px;
  part.principal_point_px -= glm::vec2(from_px);
  part.crop = {from_px, whole.size_px};
  return part;
}

/// The camera whose picture is larger by `margin_px` on all sides.
inline Camera padded(Camera camera, int margin_px) {
  camera.size_px += 2 * margin_px;
  camera.principal_point_px += static_cast<float>(margin_px);
  return camera;
}

/// Focal length in pixels of an image `height_px` high that spans `fov_y_rad` vertically.
inline float focal_from_fov_y(float fov_y_rad, int height_px) {
  return 0.5f * static_cast<float>(height_px) / std::tan(0.5f * fov_y_rad);
}

/// Camera of a view, with parallel rays where `view_height` (world units) is over 0.
inline Camera make_view_camera(const Pose& world_from_camera, glm::ivec2 size_px, float fov_y_rad,
                               float view_height, float near_z) {
  return view_height > 0.0f
             ? make_orthographic_camera(world_from_camera, size_px, view_height, near_z)
             : make_camera(world_from_camera, size_px, focal_from_fov_y(fov_y_rad, size_px.y),
                           near_z);
}

/// Rotation part of the world-to-camera transform; p_camera = R (p_world - position).
inline glm::mat3 camera_from_world_rotation(const Pose& world_from_camera) {
  return glm::mat3_cast(glm::conjugate(world_from_camera.orientation));
}

}  // namespace catgs
