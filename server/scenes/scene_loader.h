#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render_core/frame/renderer.h"
#include "server/base/background.h"
#include "server/config/config.h"
#include "server/scenes/derived_files.h"
#include "server/scenes/poster.h"
#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/scene_trees.h"

namespace catgs {

/// Loads scenes as the configuration says, with the server's renderer options. Session thread only.
class SceneLoader {
 public:
  /// All outlive this object.
  SceneLoader(const ServerConfig& config, RendererOptions core, const SceneIds& ids,
              SceneTrees& trees, const DerivedFiles* files, Background& background,
              boost::asio::io_context& io);

  /// Loads a scene on this thread, before the server runs. Throws InputError.
  std::shared_ptr<const SceneEntry> load_now(const FoundScene& found);
  /// The first scenes decide whether the server uses GPUs. Call it when they are loaded.
  void keep_core();

  /// Reads the scene's poster from the cache. Null: it is not there.
  void read_poster(const FoundScene& found, const SceneRepresentation& representation,
                   std::function<void(const Poster&)> then);
  /// Loads it in the background and calls `then`. Visitors' loads come first.
  enum class For { visitors, jobs };
  void load(const FoundScene& found, const SceneRepresentation& representation, For whom,
            std::function<void(LoadedScene)> then) {
    const auto id = load_beside({}, found, representation, whom, std::move(then));
    if (whom == For::jobs) gives_way_ = id;
  }
  /// A representation in memory.
  struct Present {
    std::shared_ptr<Renderer> renderer;  // null: none
    bool whole = false;                  // it has all Gaussians and is no tree
  };
  /// Compares the new representation with the present one, too. cancel() takes what it returns.
  Background::JobId load_beside(Present present, const FoundScene& found,
                                const SceneRepresentation& representation, For whom,
                                std::function<void(LoadedScene)> then);
  void cancel(Background::JobId load) { jobs_.cancel(load); }
  /// Ends a load() that no visitor waits for.
  void give_way() { cancel(gives_way_); }
  /// Frees a scene in the background, because that may wait for the device.
  void free_later(std::shared_ptr<const SceneEntry> entry);
  /// Looks for scenes in the background. Nothing: a folder cannot be read.
  void scan(SceneFolders& folders,
            std::function<void(std::optional<std::vector<FoundScene>>)> then);

 private:
  [[nodiscard]] LoadedScene load_on(const FoundScene& found,
                                    const SceneRepresentation& representation,
                                    const std::stop_token& stop) const;
  [[nodiscard]] KeepDerived keep(const FoundScene& found,
                                 const SceneRepresentation& representation) const;
  [[nodiscard]] TreeComparison compared(const SceneEntry& entry, const Present& present,
                                        const std::stop_token& stop) const;

  const ServerConfig& config_;
  RendererOptions core_;  // fixed once the first scenes are loaded
  const SceneIds& ids_;
  SceneTrees& trees_;
  const DerivedFiles* const files_;  // null: no --cache-dir
  Background::JobId gives_way_ = 0;  // the last such load
  Background::Jobs jobs_;
};

}  // namespace catgs
