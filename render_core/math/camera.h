#pragma once

#include <cmath>

#include <glm/ext/quaternion_float.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

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

/// The part of the world that is drawn: Gaussians whose centre c has dot(normal, c) > offset are
/// left out. A normal of 0 leaves out none.
struct ClipPlane {
  glm::vec3 normal{0.0f};  // of any length
  float offset = 0.0f;     // world units, times that length

  bool operator==(const ClipPlane&) const = default;
};

/// Where the part of a picture that a camera draws lies in the whole.
struct Crop {
  glm::ivec2 from_px{0};   // its upper left corner
  glm::ivec2 whole_px{0};  // size of the whole picture; 0: the camera draws all of it

  bool operator==(const Crop&) const = default;
};

/// A pinhole camera at a pose. Pixel centres lie at integer + 0.5.
struct Camera {
  Pose world_from_camera;
  glm::ivec2 size_px{0};
  glm::vec2 focal_px{0.0f};
  glm::vec2 principal_point_px{0.0f};
  float near_z = 0.2f;  // world units along the view axis; Gaussians nearer than this are dropped
  ClipPlane clip{};
  Crop crop{};  // the projection is clamped as in the whole picture, so that parts fit together
};

/// Whether both draw the same where they are at the same pose.
inline bool same_lens(const Camera& a, const Camera& b) {
  return a.size_px == b.size_px && a.focal_px == b.focal_px &&
         a.principal_point_px == b.principal_point_px && a.near_z == b.near_z && a.clip == b.clip &&
         a.crop == b.crop;
}

/// Camera with square pixels and the principal point in the middle of the image.
inline Camera make_camera(const Pose& world_from_camera, glm::ivec2 size_px, float focal_px,
                          float near_z = 0.2f) {
  return {world_from_camera, size_px, glm::vec2(focal_px), glm::vec2(size_px) * 0.5f, near_z};
}

/// The camera that draws a part of the picture of `whole`, which is no part itself.
inline Camera cropped(const Camera& whole, glm::ivec2 from_px, glm::ivec2 size_px) {
  Camera part = whole;
  part.size_px = size_px;
  part.principal_point_px -= glm::vec2(from_px);
  part.crop = {from_px, whole.size_px};
  return part;
}

/// Focal length in pixels of an image `height_px` high that spans `fov_y_rad` vertically.
inline float focal_from_fov_y(float fov_y_rad, int height_px) {
  return 0.5f * static_cast<float>(height_px) / std::tan(0.5f * fov_y_rad);
}

/// Rotation part of the world-to-camera transform; p_camera = R (p_world - position).
inline glm::mat3 camera_from_world_rotation(const Pose& world_from_camera) {
  return glm::mat3_cast(glm::conjugate(world_from_camera.orientation));
}

}  // namespace catgs
