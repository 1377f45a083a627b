#pragma once

#include <cstdint>
#include <filesystem>

#include "render_core/scene/files/load_scene.h"

namespace catgs {

/// How large a scene is, as its headers announce it.
struct SceneSize {
  std::uint64_t gaussians = 0;
  /// Of the scene as loaded, 0…3; where only images tell, the highest possible.
  int sh_degree = 0;

  /// Of the decoded scene; no core's copy of it is larger.
  [[nodiscard]] std::uint64_t bytes() const;
};

/// Reads headers alone, so that a folder of large scenes costs next to nothing, and a scene that is
/// too large can be refused before it is read. A count that the file cannot hold is an error here
/// already. Throws InputError, as load_scene() would.
SceneSize read_scene_size(const std::filesystem::path& path, const LoadOptions& options = {});

}  // namespace catgs
