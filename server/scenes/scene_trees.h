#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/base/clock.h"
#include "server/base/metrics.h"
#include "server/config/config.h"
#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/scene_residency.h"
#include "server/scenes/tree_cache.h"

namespace catgs {

/// Decides which scenes are drawn from trees, and builds these trees into --cache-dir. One is built
/// at a time, on few threads of low priority. All functions run on the session thread.
class SceneTrees {
 public:
  /// Without --cache-dir no scene gets a tree. `threads` build. `could_fit` tells if a scene of so
  /// many bytes may be in memory as a whole. Throws InputError that names --cache-dir if its folder
  /// cannot be used.
  SceneTrees(const ServerConfig& config, int threads, boost::asio::io_context& io, Metrics& metrics,
             std::function<TimePoint()> clock, std::function<bool(std::uint64_t bytes)> could_fit);
  ~SceneTrees();  // cancels the build under way and waits for its end

  [[nodiscard]] bool enabled() const { return cache_.has_value(); }
  /// True if the scene's tree is in the cache.
  [[nodiscard]] bool ready(const FoundScene& scene) const;
  /// True if a scene that fits into memory is still better drawn from a tree.
  [[nodiscard]] bool deserves_one(const FoundScene& scene) const;
  /// The form in which the scene can be loaded now; nothing: its tree has to be built first.
  [[nodiscard]] std::optional<SceneForm> form_of(const FoundScene& scene) const;
  /// The most memory that the scene takes on each device in that form, or as a tree, bytes.
  [[nodiscard]] std::uint64_t bytes_of(const FoundScene& scene) const;
  /// The same, as the residency counts it.
  [[nodiscard]] SceneNeed need_of(const FoundScene& scene) const;

  /// Orders a scene's tree, unless it is ordered already, or could recently not be built or used.
  /// `urgent`: visitors wait for it. Then a build that nobody waits for is cancelled and made
  /// later.
  void order(const FoundScene& scene, bool urgent);
  /// Builds a scene's tree on this thread, before the server runs. Throws InputError.
  void build_now(const FoundScene& scene);
  /// How long an ordered tree will take, from what is built of it.
  [[nodiscard]] std::chrono::seconds estimate(const FoundScene& scene) const;
  /// What is done for a scene at the moment, for people: "building tree 37 %". Often empty.
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
  struct Order {
    FoundScene scene;
    bool urgent = false;
  };
  struct Build {
    FoundScene scene;
    bool urgent = false;
    TimePoint started;
    std::atomic<double> progress{0.0};
    std::atomic<bool> cancelled{false};
  };

  /// True if the scene can be in memory as a tree alone.
  [[nodiscard]] bool needs_one(const FoundScene& scene) const;
  /// The size of the scene in the form that it has or will have.
  [[nodiscard]] SceneSize size_of(const FoundScene& scene) const;
  void start_next();
  /// Builds on this thread. Throws InputError.
  void build(const FoundScene& scene, const std::function<void(double)>& progress) const;
  void on_built(const Build& build, const std::string& error);

  const ServerConfig config_;
  const int threads_;
  boost::asio::io_context& io_;
  Metrics& metrics_;
  const std::function<TimePoint()> clock_;
  const std::function<bool(std::uint64_t bytes)> could_fit_;
  std::optional<TreeCache> cache_;
  std::deque<Order> waiting_;  // urgent ones first
  std::shared_ptr<Build> running_;
  int told_percent_ = 0;                        // of running_
  bool changed_ = false;                        // a state_of(), since the last tick
  std::optional<TimePoint> logged_;             // progress of running_
  std::map<std::string, TimePoint> given_up_;   // when, by the tree's name
  std::map<std::string, TimePoint> discarded_;  // likewise
  std::optional<boost::asio::thread_pool> builder_;
};

}  // namespace catgs
