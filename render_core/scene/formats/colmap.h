#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render_core/math/camera.h"

namespace catgs {

/// A photograph whose camera COLMAP found. Its axes are ours; the near plane is the default.
struct ColmapImage {
  std::string name;  // of its file, relative to the folder of the images
  Camera camera;
};

/// Reads a sparse reconstruction, binary or text, from `folder`/sparse/0, `folder`/sparse or
/// `folder` itself. The order is that of the file names, which is that of a video's frames.
/// Pictures with lens distortion cannot be compared with a pinhole camera's: the InputError names
/// their model. All other mistakes throw InputError too.
std::vector<ColmapImage> read_colmap(const std::filesystem::path& folder);

}  // namespace catgs
