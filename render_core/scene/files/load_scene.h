#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "render_core/scene/scene.h"

namespace catgs {

class TreeFile;

struct LoadOptions {
  std::optional<int> lod;                      // of a scene with levels; 0 is the finest
  std::optional<std::size_t> gaussian_budget;  // of a scene with levels: the finest that fit
  std::optional<glm::vec3> up;                 // unit; where no sidecar says which way is up
  std::optional<SplatModel> model;             // in place of what sidecar and file say
  bool first_view = true;  // false: it is not looked for where no file tells any of it
  std::function<void(double fraction)> progress;  // called from the loading thread, 0…1
  int threads = 0;                                // 0: one per processor
};

/// Reads any supported scene. It may be a file: .ply (original and compressed), .splat, .ksplat,
/// .spz, .sog, .ssog, .glb, .gltf, .lcc2 or .tree. It may be a folder of 3D Tiles, or a streamed or
/// unpacked SOG folder (or its tileset.json, lod-meta.json, meta.json), a training output folder
/// (its newest iteration), or a folder with a single scene file. The content of a file decides its
/// format before its name does. Throws InputError; the error for an unknown format lists the
/// supported ones. Memory peaks at the cloud and a few bytes per Gaussian.
Scene load_scene(const std::filesystem::path& path, const LoadOptions& options = {});

/// A scene in pages, of which renderers read what they need.
struct SceneInPages {
  std::shared_ptr<TreeFile> tree;
  Scene outline;  // its cloud is a coarse level, for hints and analysis; `report` is of all
};

/// Opens a .tree file. `made_of`: the scene that it was made of, if it shall have that one's name
/// and hints. Throws InputError, also for other formats.
SceneInPages open_in_pages(const std::filesystem::path& path, const LoadOptions& options = {},
                           const std::filesystem::path& made_of = {});

}  // namespace catgs
