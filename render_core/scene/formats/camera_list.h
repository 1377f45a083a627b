#pragma once

#include <optional>
#include <string>
#include <vector>

#include "render_core/math/lens.h"
#include "render_core/scene/formats/byte_source.h"

namespace catgs {

/// The camera of a photograph or of a keyframe. Its axes are ours.
struct ListedCamera {
  std::string name;  // of its picture, as the file writes it; may be empty
  Pose world_from_camera;
  Lens lens;
};

struct CameraList {
  std::vector<ListedCamera> cameras;
  std::optional<double> rate_hz;  // cameras per second, where the file says so
};

/// Reads cameras that programs of the field write as JSON. The content tells the form:
///
///   cameras.json      of a 3DGS training, in the order of the pictures' names
///   transforms.json   of nerfstudio, instant-ngp and Blender data sets; also transforms_test.json
///   camera_path.json  of nerfstudio's viewer
///   transforms_*.json that `ns-export cameras` writes
///
/// Places are returned about `origin`. Throws InputError with the field of a mistake.
CameraList read_camera_json(const ByteSource& file, const glm::dvec3& origin = glm::dvec3(0.0));

}  // namespace catgs
