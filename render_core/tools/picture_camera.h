#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "render_core/math/camera.h"

namespace catgs {

/// The key of the text in a PNG that tells the camera of the picture.
inline constexpr const char* camera_key = "catgs-camera";

/// The camera that drew a picture.
struct PictureCamera {
  Camera camera;           // its position is about the origin of the scene
  glm::dvec3 origin{0.0};  // in the coordinates of the scene's file

  [[nodiscard]] glm::dvec3 position() const {
    return glm::dvec3(camera.world_from_camera.position) + origin;
  }
};

/// Position in the coordinates of the scene's file, orientation x, y, z, w, focal lengths,
/// principal point and the scene's origin, as numbers with spaces.
std::string camera_text(const PictureCamera& of);

/// Empty for pictures of others. A text without an origin is about 0.
std::optional<PictureCamera> camera_of_picture(const std::filesystem::path& path);

/// How far two cameras are from seeing the same.
struct CameraDifference {
  double units = 0.0, degrees = 0.0;  // between their positions and their orientations
  double pixels = 0.0;                // between focal lengths or principal points

  /// More than what is lost when numbers are written and read. Positions are held about an
  /// origin, so they lose in proportion to their distance from it.
  [[nodiscard]] bool matters() const { return matters_; }

  CameraDifference(const PictureCamera& a, const PictureCamera& b);

 private:
  bool matters_;
};

}  // namespace catgs
