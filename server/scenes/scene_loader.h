#pragma once

#include <atomic>
#include <memory>

#include "render_core/frame/renderer.h"
#include "server/config/config.h"
#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/scene_trees.h"

namespace catgs {

/// Loads scenes as the configuration says, with the server's renderer options.
class SceneLoader {
 public:
  /// All outlive this object.
  SceneLoader(const ServerConfig& config, RendererOptions core, const SceneIds& ids,
              SceneTrees& trees);

  /// Loads a scene on this thread, before the server runs. Throws InputError.
  std::shared_ptr<const SceneEntry> load_now(const FoundScene& found);
  /// The first scenes decide whether the server uses GPUs. Call it when they are loaded.
  void keep_core();

  /// Any thread. `gives_way`: no visitor waits for it, and it ends when one waits for another load.
  LoadedScene load(const FoundScene& found, const SceneForm& form, bool gives_way) const;
  /// Any thread. Ends a load that gives way.
  void give_way() { give_way_ = true; }
  /// Call it before a load that gives way.
  void begin_in_background() { give_way_ = false; }
  /// Any thread. Ends all loads.
  void stop() { stopping_ = true; }

 private:
  const ServerConfig& config_;
  RendererOptions core_;  // fixed once the first scenes are loaded
  const SceneIds& ids_;
  SceneTrees& trees_;
  std::atomic<bool> give_way_{false}, stopping_{false};
};

}  // namespace catgs
