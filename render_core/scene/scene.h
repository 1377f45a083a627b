#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/math/camera.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene_about.h"

namespace catgs {

/// The faults found among the Gaussians of a file, and how they were treated (see sanitize.h).
struct SanitizeReport {
  std::size_t read = 0;      // Gaussians in the file
  std::size_t dropped = 0;   // removed; the sum of the next three
  std::size_t repaired = 0;  // kept with changed values; one Gaussian may count in several below

  std::size_t not_finite = 0;  // dropped: NaN or infinite mean, scale, rotation or opacity
  std::size_t invisible = 0;   // dropped: peak alpha under 1/255, which no pipeline draws
  std::size_t absurd = 0;      // dropped: beyond any reasonable distance or size

  std::size_t zero_rotations = 0;  // repaired: quaternion 0 became the identity
  std::size_t clamped = 0;         // repaired: scale or opacity moved into the valid range
  std::size_t zeroed_sh = 0;       // repaired: NaN or infinite SH coefficients became 0
};

struct Bounds {
  glm::vec3 min{0.0f};
  glm::vec3 max{0.0f};
};

/// Hints for the first view of a scene: from a sidecar, from the training's cameras.json, or
/// estimated from the Gaussians.
struct SceneHints {
  glm::vec3 up{0.0f, -1.0f, 0.0f};  // unit, world axes; y points down in 3DGS captures
  Pose start_pose;                  // world_from_camera
  float near_z = 0.2f;              // world units
  Bounds limits;                    // where the camera may go, world axes
  glm::vec3 focus{0.0f};            // the point that orbiting turns around
  float scale = 1.0f;               // to a visitor, world units: how far free sight is, about
  SceneAbout about;
  glm::dvec3 origin{0.0};       // places and the cloud are about it: see scene_origin.h
  bool up_is_doubtful = false;  // files like the scene's may be upside down, and nobody has said
  std::string source;  // "sidecar scene.json", "cameras.json", "estimated"; "" not looked for
};

/// A scene ready to be rendered.
struct Scene {
  std::string name;    // file or folder name without extension; UTF-8, other bytes read U+FFFD
  std::string format;  // "3DGS ply", "sog v2 (zip)", …
  GaussianCloud cloud;
  SceneHints hints;
  SanitizeReport report;
  std::vector<std::string> notes;  // for people: files found beside the scene but not used
};

}  // namespace catgs
