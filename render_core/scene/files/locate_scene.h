#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/scene/files/hints.h"

namespace catgs {

/// For error messages.
inline constexpr std::string_view supported_scenes =
    "supported: .ply (3DGS or compressed), .splat, .ksplat, .spz, .sog, .ssog, .glb, .gltf, .lcc2, "
    ".tree, a folder with lod-meta.json (streamed SOG), meta.json (SOG) or tileset.json "
    "(3D Tiles), a training output folder";

/// Whether a file has an extension of those formats.
bool is_scene_name(const std::filesystem::path& path);

/// Whether a file stands for its folder as a scene: lod-meta.json, meta.json or tileset.json.
bool is_scene_index(const std::filesystem::path& file);
/// Whether a folder has such a file, or one of LCC2.
bool has_scene_index(const std::filesystem::path& folder);

/// The scene that a path given by a user names.
struct SceneLocation {
  enum class Kind {
    file,
    sog_folder,
    streamed_sog_folder,
    streamed_sog_archive,
    tiles_folder,
    lcc2
  };
  Kind kind = Kind::file;
  std::filesystem::path path;  // of the file or the folder
  /// Whether there are levels of detail to choose from.
  [[nodiscard]] bool has_levels() const { return kind != Kind::file && kind != Kind::sog_folder; }
  [[nodiscard]] bool is_streamed_sog() const {
    return kind == Kind::streamed_sog_folder || kind == Kind::streamed_sog_archive;
  }
  std::string index;  // the .lcc2 in the folder `path`
  std::string name;   // for people
  HintFiles hints;
};

/// Resolves files, folders with an index (also by that file), training output folders (newest
/// iteration) and folders with a single scene file. Throws InputError.
SceneLocation locate_scene(const std::filesystem::path& path);

/// The files beside a .gltf that hold its data, as far as its JSON can be read; none for others.
std::vector<std::filesystem::path> files_beside(const std::filesystem::path& scene);

}  // namespace catgs
