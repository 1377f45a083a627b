#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "render_core/scene/files/scene_size.h"
#include "server/config.h"
#include "server/scenes/scene_entry.h"

namespace catgs {

/// The memory for the pages of all trees on each device, bytes: half of --scene-memory. Whole
/// scenes have the other half, and all of it while no tree is in memory.
std::uint64_t tree_memory(const ServerConfig& config);

/// The most memory that a scene of this size takes on each device, bytes.
std::uint64_t most_bytes(const SceneSize& size, const ServerConfig& config);

/// Loads one scene (a path, or synth:KIND:COUNT[:SEED]) and builds its renderer with the options
/// and pools of `core`. `id_of` makes the id from the name. `threads` threads read the file.
/// `progress` is called repeatedly and may throw to cancel. Throws InputError.
std::shared_ptr<const SceneEntry> load_scene(
    const std::string& spec, const std::function<std::string(const std::string& name)>& id_of,
    const ServerConfig& config, const RendererOptions& core, int threads,
    const std::function<void(double)>& progress = {});

/// Loads every configured scene once, for all sessions. Throws InputError, because a bad scene is
/// an operator's mistake that should stop the server.
std::vector<std::shared_ptr<const SceneEntry>> load_scenes(const ServerConfig& config,
                                                           const RendererOptions& core);

}  // namespace catgs
