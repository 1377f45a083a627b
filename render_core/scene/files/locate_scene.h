#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "render_core/scene/files/hints.h"

namespace catgs {

/// For error messages.
inline constexpr std::string_view supported_scenes =
    "supported: .ply (3DGS or compressed), .splat, .ksplat, .spz, .sog, .ssog, .glb, .gltf, .tree, "
    "a folder with lod-meta.json (streamed SOG) or meta.json (SOG), a training output folder";

/// Whether a file has an extension of those formats.
bool is_scene_name(const std::filesystem::path& path);

/// The scene that a path given by a user names.
struct SceneLocation {
  enum class Kind { file, sog_folder, streamed_sog_folder, streamed_sog_archive };
  Kind kind = Kind::file;
  std::filesystem::path path;  // of the file or the folder
  /// Whether there are levels of detail to choose from.
  [[nodiscard]] bool is_streamed() const {
    return kind == Kind::streamed_sog_folder || kind == Kind::streamed_sog_archive;
  }
  std::string name;  // for people
  HintFiles hints;
};

/// Resolves files, SOG folders (also by their meta.json or lod-meta.json), training output folders
/// (newest iteration) and folders with a single scene file. Throws InputError.
SceneLocation locate_scene(const std::filesystem::path& path);

}  // namespace catgs
