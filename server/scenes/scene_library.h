#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <boost/asio/io_context.hpp>

#include "server/base/background.h"
#include "server/base/metrics.h"
#include "server/config/config.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/scene_index.h"
#include "server/scenes/scene_loader.h"
#include "server/scenes/scene_memory.h"
#include "server/scenes/scene_source.h"
#include "server/scenes/scene_trees.h"
#include "server/scenes/walkable_areas.h"

namespace catgs {

/// All scenes of the server. Those of --scene stay in memory; those of --scene-folder are loaded on
/// demand. Loading, releasing and scanning happen one after the other in the background. All
/// functions run on the session thread unless marked.
class SceneLibrary final : public SceneSource {
 public:
  using Listing = SceneListing;

  /// Loads the scenes of --scene, or else the first scene of the folders that can be loaded. So a
  /// running server can always show one. `clock` times loads. Throws InputError.
  SceneLibrary(const ServerConfig& config, RendererOptions core, Background& background,
               boost::asio::io_context& io, Metrics& metrics,
               std::function<TimePoint()> clock = Clock::now);

  [[nodiscard]] std::vector<std::string> scene_ids() const override { return index_.scene_ids(); }
  /// Any thread. See SceneIndex.
  [[nodiscard]] std::string resolve(std::string_view name) const override {
    return index_.resolve(name);
  }
  [[nodiscard]] bool has(const std::string& id) const override {
    return index_.records().contains(id);
  }
  SceneAnswer want(const std::string& id, TimePoint now) override { return memory_.want(id, now); }
  /// Does nothing while a scene is being loaded, or where the scene would not fit beside those in
  /// memory. Two scenes at a time are loaded so and not entered; the older one is released for
  /// another when it has stayed as long as any scene does.
  void prepare(const std::string& id, TimePoint now) override { memory_.prepare(id, now); }
  [[nodiscard]] std::shared_ptr<const SceneEntry> newer_representation(
      const SceneEntry& seen) override {
    return memory_.newer_representation(seen);
  }
  void on_tick(TimePoint now) override;

  /// A background job's hold on a scene in memory, unless that has to leave. `again`: the job had
  /// the scene before, and it is loaded for it where that costs no visitor anything.
  [[nodiscard]] LeasedScene lease(const std::string& id, bool again = false) {
    return memory_.lease(id, again);
  }
  /// Replaces the scene's entry for clients that arrive from now on. Does nothing if the scene was
  /// reloaded since `entry` was made.
  void revise(const std::string& id, std::shared_ptr<const SceneEntry> entry);

  /// Any thread.
  [[nodiscard]] std::shared_ptr<const std::vector<Listing>> listing() const {
    return index_.listing();
  }
  /// Any thread. Takes the scene's poster from the cache, or loads the scene to make it, which then
  /// stays for its first visitor.
  void want_poster(const std::string& id);
  /// Any thread. Finds where people can walk in a scene in memory, one scene at a time. Does
  /// nothing where that is known or under way.
  void want_walkable_area(const std::string& id);

 private:
  void pin_scenes();
  void open_folders();
  void merge(std::vector<FoundScene> found);

  const ServerConfig config_;
  boost::asio::io_context& io_;
  Metrics& metrics_;
  const std::function<TimePoint()> clock_;
  const std::unique_ptr<DerivedFiles> files_;  // null: no --cache-dir
  SceneTrees trees_;
  const SceneScanOptions scan_options_;
  SceneFolders folders_;  // used by the loader's scans after construction
  SceneLoader loads_;
  SceneIndex index_;
  SceneMemory memory_;
  std::optional<TimePoint> next_scan_;  // nothing without folders, and while a scan runs
  WalkableAreas walkable_areas_;
};

}  // namespace catgs
