#pragma once

#include <cstdint>
#include <filesystem>

#include "render_core/scene/files/load_scene.h"

namespace catgs {

/// The size of a scene, as announced by its headers.
struct SceneSize {
  std::uint64_t gaussians = 0;
  /// SH degree of the scene as loaded, 0…3; where only images tell it, the highest possible one.
  int sh_degree = 0;
  bool in_pages = false;  // a tree, of which any part may be in memory

  /// Size of the decoded scene; no core's copy is larger.
  [[nodiscard]] std::uint64_t bytes() const;
};

/// Reads headers alone. A folder of large scenes therefore costs next to nothing, and a scene that
/// is too large can be refused before it is read. A count that the file cannot hold is an error
/// already. Throws InputError, as load_scene() would.
SceneSize read_scene_size(const std::filesystem::path& path, const LoadOptions& options = {});

}  // namespace catgs
