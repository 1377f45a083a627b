#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render_core/math/lens.h"
#include "render_core/motion/trajectory.h"

namespace catgs {

/// A camera's path as a file describes it.
struct CameraPath {
  Trajectory poses;
  // One for each pose; empty where the form of the file has none.
  std::vector<std::string> names{};  // of pictures, as the file writes them; may be empty
  std::vector<Lens> lenses{};
  glm::dvec3 origin{0.0};  // that the poses are about; the file counts from 0

  /// The poses about the origin of a scene.
  [[nodiscard]] Trajectory poses_about(const glm::dvec3& scene_origin) const;
};

/// Poses per second of a path whose file has no times, unless the caller knows better.
inline constexpr double default_pose_rate_hz = 30.0;

/// The help texts name the forms that read_camera_path() takes.
inline constexpr const char* camera_path_forms =
    "a TUM file, cameras.json of a 3DGS training, transforms.json or camera_path.json of "
    "nerfstudio, or a COLMAP folder";

/// Reads a path in any of these forms; the content tells which. Poses without times follow each
/// other at `rate_hz`: photographs by name, others as the file lists them. A path far from 0 is
/// about an origin near its first pose. Throws InputError.
CameraPath read_camera_path(const std::filesystem::path& path,
                            double rate_hz = default_pose_rate_hz);

}  // namespace catgs
