#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/scene.h"

namespace catgs {

class TreeFile;

struct LoadOptions {
  std::optional<int> lod;                      // of a scene with levels; 0 is the finest
  std::optional<std::size_t> gaussian_budget;  // of a scene with levels: the finest that fit
  std::optional<glm::vec3> up;                 // unit; where no sidecar says which way is up
  std::optional<SplatModel> model;             // in place of what sidecar and file say
  KeepView keep_view;                          // null: the first view is estimated at each load
  bool first_view = true;  // false: it is not looked for where no file tells any of it
  std::function<void(double fraction)> progress;  // called from the loading thread, 0…1
  int threads = 0;                                // 0: one per processor
};

/// Reads a scene. Throws InputError. Memory peaks at the cloud, a few bytes per Gaussian
/// and a ViewSample.
Scene load_scene(const SceneLocation& location, const LoadOptions& options = {});
/// The same for a path that locate_scene() resolves.
Scene load_scene(const std::filesystem::path& path, const LoadOptions& options = {});

/// A scene in pages, of which renderers read what they need.
struct SceneInPages {
  std::shared_ptr<TreeFile> tree;
  Scene outline;  // its cloud is a coarse level, for hints and analysis; `report` is of all
};

/// Opens a scene of a format that is read in pages. Throws InputError, also for other formats.
SceneInPages open_in_pages(const SceneLocation& location, const LoadOptions& options = {});
/// Opens the .tree file that was made of a scene, with the scene's name and hints.
SceneInPages open_in_pages(const std::filesystem::path& tree, const SceneLocation& made_of,
                           const LoadOptions& options);

}  // namespace catgs
