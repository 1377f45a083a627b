#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "render_core/math/camera.h"

namespace catgs {

/// The key of the text in a PNG that tells the camera of the picture.
inline constexpr const char* camera_key = "catgs-camera";

/// Position, orientation x, y, z, w, focal lengths and principal point, as numbers with spaces.
std::string camera_text(const Camera& camera);

/// The camera that drew a picture; empty for pictures of others.
std::optional<Camera> camera_of_picture(const std::filesystem::path& path);

/// How far two cameras are from seeing the same.
struct CameraDifference {
  double units = 0.0, degrees = 0.0;  // between their positions and their orientations
  double pixels = 0.0;                // between focal lengths or principal points

  /// More than what is lost when numbers are written and read.
  [[nodiscard]] bool matters() const { return matters_; }

  CameraDifference(const Camera& a, const Camera& b);

 private:
  bool matters_;
};

}  // namespace catgs
