#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/base/metrics.h"
#include "server/config/config.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/scene_grounds.h"
#include "server/scenes/scene_loader.h"
#include "server/scenes/scene_posters.h"
#include "server/scenes/scene_redrawing.h"
#include "server/scenes/scene_residency.h"
#include "server/scenes/scene_shelf.h"
#include "server/scenes/scene_source.h"
#include "server/scenes/scene_trees.h"

namespace catgs {

/// All scenes of the server. Those of --scene stay in memory; those of --scene-folder are loaded on
/// demand. Loading, releasing and scanning happen one after the other on a separate thread. All
/// functions run on the session thread unless marked.
class SceneLibrary final : public SceneSource {
 public:
  using Listing = SceneListing;

  /// Loads the scenes of --scene, or else the first scene of the folders that can be loaded. So a
  /// running server can always show one. `clock` times loads. Throws InputError.
  SceneLibrary(const ServerConfig& config, RendererOptions core, boost::asio::io_context& io,
               Metrics& metrics, std::function<TimePoint()> clock = Clock::now);
  ~SceneLibrary() override;  // waits until the current part of a scene is read

  [[nodiscard]] std::string default_scene() const override { return shelf_.default_scene(); }
  [[nodiscard]] std::vector<std::string> scene_ids() const override { return shelf_.scene_ids(); }
  /// Any thread. See SceneShelf.
  [[nodiscard]] std::string resolve(std::string_view wish) const override {
    return shelf_.resolve(wish);
  }
  [[nodiscard]] bool has(const std::string& id) const override {
    return shelf_.books().contains(id);
  }
  SceneAnswer want(const std::string& id, TimePoint now) override;
  /// Does nothing while a scene is being loaded, or where the scene would not fit beside those in
  /// memory. Two scenes at a time are loaded so and not entered; the older one is released for
  /// another when it has stayed as long as any scene does.
  void prepare(const std::string& id, TimePoint now) override;
  [[nodiscard]] std::shared_ptr<const SceneEntry> newer_form(const SceneEntry& seen) override {
    return redrawing_.newer_form(seen);
  }
  void on_tick(TimePoint now) override;

  /// Returns null if the scene is not in memory.
  [[nodiscard]] std::shared_ptr<const SceneEntry> in_memory(const std::string& id) const;
  /// A background job's hold on a scene in memory, unless that has to leave. `again`: the job had
  /// the scene before, and it is loaded for it where that costs no visitor anything.
  [[nodiscard]] LeasedScene lease(const std::string& id, bool again = false);
  /// Replaces the scene's entry for clients that arrive from now on. Does nothing if the scene was
  /// reloaded since `entry` was made.
  void revise(const std::string& id, std::shared_ptr<const SceneEntry> entry);

  /// The renderer's description for the default scene.
  [[nodiscard]] std::string renderer_text() const;
  /// Any thread.
  [[nodiscard]] std::shared_ptr<const std::vector<Listing>> listing() const {
    return shelf_.listing();
  }
  /// Any thread. See ScenePosters.
  void want_poster(const std::string& id);
  /// Any thread. Finds where people can walk in a scene in memory, one scene at a time. Does
  /// nothing where that is known or under way.
  void want_ground(const std::string& id);

 private:
  void pin_scenes();
  void open_folders();
  /// Loads a scene of the folders as the default one. Throws InputError.
  void begin_with(const std::string& id);
  void start_next(TimePoint now);
  void carry_out(const SceneResidency::Step& step, bool gives_way, TimePoint now);
  void on_loaded(const std::string& id, LoadedScene loaded, TimePoint started, TimePoint now);
  void release(const std::string& id);
  void start_scan();
  void merge(std::vector<FoundScene> found);
  /// Updates listing() and the metrics.
  void publish();

  const ServerConfig config_;
  boost::asio::io_context& io_;
  Metrics& metrics_;
  const std::function<TimePoint()> clock_;
  SceneTrees trees_;
  const SceneLook look_;
  SceneLoader loads_;
  SceneFolders folders_;  // used on the loader's thread after construction
  SceneShelf shelf_;
  SceneResidency residency_;
  const SceneResidency::UseOf use_of_;
  double bytes_per_second_ = 100e6;     // of the last load
  std::optional<TimePoint> next_scan_;  // nothing without folders, and while a scan runs
  struct Prepared {
    std::string id;
    TimePoint since;
  };
  std::vector<Prepared> prepared_;  // and not entered since, oldest first

  boost::asio::thread_pool loader_{1};
  SceneRedrawing redrawing_;
  ScenePosters posters_;
  SceneGrounds grounds_;
};

}  // namespace catgs
