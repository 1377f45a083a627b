#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>

#include "render_core/scene/files/load_scene.h"

namespace catgs {

struct TreeBuild {
  SceneLocation scene;
  LoadOptions levels;  // of a scene that has some; only `lod` and `gaussian_budget` count
  std::optional<glm::vec3> up{};  // as LoadOptions has them, for the first view
  KeepView keep_view{};
  std::filesystem::path out;  // appears when it is whole
  std::size_t memory_bytes = 0;
  int threads = 1;
};

/// Estimates a file's first view, unless it is kept, and then builds a scene's tree on this thread
/// and further ones. Formats that can be read in parts take `memory_bytes` and about 200 MB; others
/// are loaded for that. `progress` is called often, with 0…1, and may throw to cancel. Throws
/// InputError: the scene is wrong, there is no room on the disk.
void build_scene_tree(const TreeBuild& build, const std::function<void(double)>& progress);

}  // namespace catgs
