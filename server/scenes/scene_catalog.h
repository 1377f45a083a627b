#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render_core/base/error.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/scene_size.h"
#include "server/config/config.h"
#include "server/scenes/poster.h"
#include "server/scenes/scene_entry.h"
#include "server/scenes/tree_comparison.h"

namespace catgs {

/// The memory for the pages of all trees on each device, bytes: half of --scene-memory. Whole
/// scenes have the other half, and all of it while no tree is in memory.
std::uint64_t tree_memory(const ServerConfig& config);

/// The most memory that a scene of this size takes on each device, bytes.
std::uint64_t most_bytes(const SceneSize& size, const ServerConfig& config);

/// The levels of detail that the configuration chooses.
LoadOptions chosen_levels(const ServerConfig& config);

/// The scenes of --scene. Of synth:KIND:COUNT[:SEED], only `given` is set. Throws InputError if one
/// is not there, or if levels are chosen and none has levels.
std::vector<SceneLocation> locate_scenes(const ServerConfig& config);

/// The Gaussians of synth:KIND:COUNT[:SEED], in parts that are let go once `take` returns. Throws
/// InputError.
void synthesize_parts(const std::string& spec, ThreadPool& pool,
                      const std::function<void(const GaussianCloud&)>& take);

/// The representation in which a scene comes into memory.
struct SceneRepresentation {
  std::filesystem::path tree{};    // of a cache, to be read instead of the scene
  std::size_t most_gaussians = 0;  // its finest levels that fit, if it has levels; 0: as configured
};

/// A tree of a cache is damaged, or of another version.
struct UnusableTree : InputError {
  using InputError::InputError;
};

/// A scene that was loaded, or why it was not.
struct LoadedScene {
  std::shared_ptr<const SceneEntry> entry;
  std::string error{};
  bool unusable_tree = false;                // the error is that of the scene's tree
  bool gave_way = false;                     // no error: a visitor's load came first
  std::optional<TreeComparison> compared{};  // with the representation in memory
};

/// How that which is computed of a scene is kept for the next load. Empty: it is not.
struct KeepDerived {
  KeepView view{};
  KeepPoster poster{};
};

/// Loads one scene in a representation and builds its renderer with the options and pool of `core`.
/// `id_of` makes the id from the name. `threads` threads read the file. `progress` is called
/// repeatedly and may throw to cancel. Throws InputError or UnusableTree.
std::shared_ptr<const SceneEntry> load_scene(
    const SceneLocation& location, const SceneRepresentation& representation,
    const std::function<std::string(const std::string& name)>& id_of, const ServerConfig& config,
    const RendererOptions& core, int threads, const std::function<void(double)>& progress = {},
    const KeepDerived& keep = {});

}  // namespace catgs
