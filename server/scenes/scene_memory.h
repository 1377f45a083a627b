#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/base/metrics.h"
#include "server/config/config.h"
#include "server/scenes/scene_index.h"
#include "server/scenes/scene_loader.h"
#include "server/scenes/scene_posters.h"
#include "server/scenes/scene_redrawing.h"
#include "server/scenes/scene_residency.h"
#include "server/scenes/scene_source.h"
#include "server/scenes/scene_trees.h"

namespace catgs {

/// Brings scenes into memory when somebody wants them, and lets them go for others. Session thread
/// only.
class SceneMemory {
 public:
  /// All outlive this object.
  SceneMemory(const ServerConfig& config, SceneIndex& index, SceneTrees& trees, SceneLoader& loader,
              Metrics& metrics, std::function<TimePoint()> clock);

  /// Counts a scene that stays in memory for good.
  void pin(const std::string& id, const SceneEntry& entry) { residency_.pin(id, need_of(entry)); }
  /// Loads a scene before the server runs. Throws InputError.
  void load_now(const std::string& id);
  /// That has failed.
  void failed_now(const std::string& id, const std::string& error);

  // See SceneSource and SceneLibrary.
  SceneAnswer want(const std::string& id, TimePoint now);
  void prepare(const std::string& id, TimePoint now);
  [[nodiscard]] LeasedScene lease(const std::string& id, bool again);
  void want_poster(const std::string& id) { posters_.want(id); }
  [[nodiscard]] std::shared_ptr<const SceneEntry> newer_representation(
      const SceneEntry& seen) const {
    return redrawing_.newer_representation(seen);
  }
  void on_tick(TimePoint now);

  [[nodiscard]] bool awaited(const std::string& id) const { return residency_.awaited(id); }
  [[nodiscard]] bool could_fit(std::uint64_t bytes) const { return residency_.could_fit(bytes); }
  /// Updates the listing and the metrics.
  void publish();

 private:
  void start_next(TimePoint now);
  /// Does nothing while a scene is loaded, or where there is no room. The scene stays for its
  /// first visitor until others need its memory.
  void load_for_poster(SceneRecord& record);
  /// The oldest scene that was loaded for its poster leaves, unless a job uses it.
  void drop_unvisited();
  /// Returns false if nothing is loaded, as the scene's tree is not there any more.
  bool carry_out(const SceneResidency::Step& step, SceneLoader::For whom, TimePoint now);
  /// `found`: what was loaded. The index may have found other files meanwhile.
  void on_loaded(const FoundScene& found, LoadedScene loaded, TimePoint started, TimePoint now);
  void release(const std::string& id);

  const ServerConfig& config_;
  SceneIndex& index_;
  SceneTrees& trees_;
  SceneLoader& loads_;
  Metrics& metrics_;
  const std::function<TimePoint()> clock_;
  SceneResidency residency_;
  const SceneResidency::UseOf use_of_;
  double bytes_per_second_ = 100e6;  // of the last load
  struct Prepared {
    std::string id;
    TimePoint since;
  };
  std::vector<Prepared> prepared_;      // and not entered since, oldest first
  std::vector<std::string> unvisited_;  // loaded for their posters, oldest first
  SceneRedrawing redrawing_;
  ScenePosters posters_;
};

}  // namespace catgs
