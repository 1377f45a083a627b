#pragma once

#include <filesystem>
#include <vector>

#include "render_core/scene/formats/camera_list.h"

namespace catgs {

/// Lenses that bend straight lines are refused, or taken as if they were straight.
enum class Distortion { refused, ignored };

/// Reads a sparse reconstruction, binary or text, from `folder`/sparse/0, `folder`/sparse or
/// `folder` itself. The order is that of the file names, which is that of a video's frames.
/// Distorted pictures cannot be compared with a pinhole camera's, but their poses are good for a
/// path. Where distortion is refused, the InputError names the model. All other mistakes throw
/// InputError too. Places are returned about `origin`.
std::vector<ListedCamera> read_colmap(const std::filesystem::path& folder, Distortion distortion,
                                      const glm::dvec3& origin = glm::dvec3(0.0));

}  // namespace catgs
