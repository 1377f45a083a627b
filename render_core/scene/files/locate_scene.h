#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render_core/scene/files/hints.h"
#include "render_core/scene/formats/scene_format.h"

namespace catgs {

/// Whether a file has an extension of a known format.
bool is_scene_name(const std::filesystem::path& path);

/// Whether a file stands for its folder as a scene, like meta.json.
bool is_scene_index(const std::filesystem::path& file);
/// Whether a folder has such a file, or one of a format whose files name their folders.
bool has_scene_index(const std::filesystem::path& folder);

/// A scene's files and their format. It is found once and handed on to all that read the scene.
struct SceneLocation {
  std::filesystem::path given;  // the path that a user gave
  const SceneFormat* format = nullptr;
  SceneFiles files{};
  std::string name{};  // for people
  HintFiles hints{};

  /// Whether there are levels of detail to choose from.
  [[nodiscard]] bool has_levels() const { return format != nullptr && format->open_levels; }
  /// Whether renderers can read what they need of it.
  [[nodiscard]] bool is_in_pages() const { return format != nullptr && format->in_pages; }
};

/// Resolves files, folders with an index (also by that file), training output folders (newest
/// iteration) and folders with a single scene file. Throws InputError.
SceneLocation locate_scene(const std::filesystem::path& path);

/// The files beside a scene's file that hold its data, as far as that can be read.
std::vector<std::filesystem::path> files_beside(const std::filesystem::path& scene);

}  // namespace catgs
