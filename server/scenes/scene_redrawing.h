#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/base/clock.h"
#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_residency.h"
#include "server/scenes/scene_shelf.h"
#include "server/scenes/scene_trees.h"

namespace catgs {

/// The memory that a scene takes.
inline SceneNeed need_of(const SceneEntry& entry) {
  return {entry.renderer->scene_bytes(), entry.in_pages};
}

/// Has trees built for scenes in memory, and draws these scenes from their trees as soon as they
/// are there: one scene at a time, and for present visitors, too. A tree that turns out to be
/// damaged is built again. Session thread only.
class SceneRedrawing {
 public:
  using Load = std::function<LoadedScene(const FoundScene& found, const SceneForm& form)>;

  /// `load` is called on `loader`. All outlive this object, and its tasks.
  SceneRedrawing(SceneShelf& shelf, SceneTrees& trees, SceneResidency& residency,
                 boost::asio::io_context& io, boost::asio::thread_pool& loader, Load load)
      : shelf_(shelf),
        trees_(trees),
        residency_(residency),
        io_(io),
        loader_(loader),
        load_(std::move(load)) {}

  struct Tick {
    std::vector<std::string> too_large;  // ids of unused scenes whose two forms do not fit together
    bool changed = false;                // the listing has
  };
  Tick on_tick(TimePoint now);

  /// True while a scene takes the memory of two forms. One of them goes soon.
  [[nodiscard]] bool holds_two_forms() const;

  /// See SceneSource.
  [[nodiscard]] std::shared_ptr<const SceneEntry> newer_form(const SceneEntry& seen) const;

 private:
  void start(const std::string& id);
  void on_loaded(const std::string& id, const FoundScene& found, LoadedScene loaded,
                 const std::shared_ptr<Renderer>& before);
  /// Frees a scene on the loader's thread, because that may wait for the device.
  void free_later(std::shared_ptr<const SceneEntry> entry);

  SceneShelf& shelf_;
  SceneTrees& trees_;
  SceneResidency& residency_;
  boost::asio::io_context& io_;
  boost::asio::thread_pool& loader_;
  const Load load_;
  bool busy_ = false;
  bool changed_ = false;  // the listing, since the last tick
};

}  // namespace catgs
