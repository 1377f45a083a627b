#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include <boost/asio/io_context.hpp>

#include "server/base/background.h"
#include "server/base/metrics.h"
#include "server/config/config.h"
#include "server/scenes/derived_files.h"
#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/scene_residency.h"
#include "server/scenes/tree_choices.h"

namespace catgs {

/// Decides which scenes are drawn from trees, and builds these trees into --cache-dir. One is built
/// at a time, on few threads of low priority. All functions run on the session thread.
class SceneTrees {
 public:
  /// `cache`: null: no scene gets a tree. `threads` build. `could_fit` tells if a scene of so many
  /// bytes may be in memory as a whole.
  SceneTrees(const ServerConfig& config, DerivedFiles* cache, int threads, Background& background,
             boost::asio::io_context& io, Metrics& metrics, std::function<TimePoint()> clock,
             std::function<bool(std::uint64_t bytes)> could_fit);

  [[nodiscard]] bool enabled() const { return cache_ != nullptr; }
  /// True if the scene's tree is in the cache.
  [[nodiscard]] bool ready(const FoundScene& scene) const;
  /// True if a scene that fits into memory is still better drawn from a tree.
  [[nodiscard]] bool deserves_one(const FoundScene& scene) const;
  /// The one of the two that looks better.
  [[nodiscard]] TreeChoices& choices() { return choices_; }
  /// True if the scene may look better without its tree, with which it was not compared yet.
  [[nodiscard]] bool undecided(const FoundScene& scene) const;
  /// The representation in which the scene can be loaded now; nothing: its tree has to be built
  /// first. `from_tree`: from a tree if that is there and suits it.
  [[nodiscard]] std::optional<SceneRepresentation> representation_of(const FoundScene& scene,
                                                                     bool from_tree = true) const;
  /// The most memory that the scene takes on each device in that representation, or as a tree,
  /// bytes.
  [[nodiscard]] std::uint64_t bytes_of(const FoundScene& scene, bool from_tree = true) const;
  /// The same, as the residency counts it.
  [[nodiscard]] SceneNeed need_of(const FoundScene& scene, bool from_tree = true) const;

  /// Orders a scene's tree, unless it is ordered already, or could recently not be built or used.
  /// `urgent`: visitors wait for it. Then a build that nobody waits for is made later.
  void order(const FoundScene& scene, bool urgent);
  /// Builds a scene's tree on this thread, before the server runs. Throws InputError.
  void build_now(const FoundScene& scene);
  /// How long an ordered tree will take, from what is built of it.
  [[nodiscard]] std::chrono::seconds estimate(const FoundScene& scene) const;
  /// A scene's state, for people: "building tree 37 %". Often empty.
  [[nodiscard]] std::string state_of(const FoundScene& scene) const;

  /// The scene's tree is damaged: removes it. Where that happens again soon, the disk is to blame,
  /// and no tree is built for a while.
  void discard(const FoundScene& scene, const std::string& why);
  /// The scene's tree cannot be built or used: nothing is tried for a while.
  void give_up(const FoundScene& scene, const std::string& why);
  /// True: given up, not long ago.
  [[nodiscard]] bool given_up(const FoundScene& scene) const;
  /// Removes what the present scenes do not need, and cancels builds for other scenes. `names`: of
  /// the trees of these scenes.
  void keep(const std::set<std::string>& names);
  /// Reports progress. True: a state_of() has changed.
  bool on_tick(TimePoint now);

 private:
  struct Build {
    FoundScene scene;
    std::atomic<bool> begun{false};
    std::atomic<double> progress{0.0};
    std::optional<TimePoint> started{}, logged{};  // by the first tick after it has begun
    Background::JobId job = 0;
  };
  using SharedBuild = std::shared_ptr<Build>;

  /// The build under way; null: none.
  [[nodiscard]] SharedBuild running() const;
  /// True if the scene can be in memory as a tree alone.
  [[nodiscard]] bool needs_one(const FoundScene& scene) const;
  /// True if it can be in memory without a tree.
  [[nodiscard]] bool has_other(const FoundScene& scene) const {
    return scene.location.has_levels() || !needs_one(scene);
  }
  /// True if its tree is there and suits it.
  [[nodiscard]] bool is_drawn_from_tree(const FoundScene& scene) const;
  /// Builds on this thread. Throws InputError.
  void build(const FoundScene& scene, const std::function<void(double)>& progress) const;
  void on_built(const SharedBuild& build, const Finished<Clock::duration>& built);

  const ServerConfig config_;
  const int threads_;
  Metrics& metrics_;
  const std::function<TimePoint()> clock_;
  const std::function<bool(std::uint64_t bytes)> could_fit_;
  DerivedFiles* const cache_;
  TreeChoices choices_;
  std::map<std::string, SharedBuild> builds_;   // ordered, by the tree's name
  int told_percent_ = 0;                        // of the build under way
  bool changed_ = false;                        // a state_of(), since the last tick
  std::map<std::string, TimePoint> given_up_;   // when, by the tree's name
  std::map<std::string, TimePoint> discarded_;  // likewise
  Background::Jobs jobs_;
};

}  // namespace catgs
