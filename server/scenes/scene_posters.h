#pragma once

#include <functional>
#include <string>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_residency.h"
#include "server/scenes/scene_shelf.h"
#include "server/scenes/scene_trees.h"

namespace catgs {

/// Loads scenes for a moment to make their posters, one at a time. Session thread only.
class ScenePosters {
 public:
  /// Loads a scene, unless a visitor's load comes first.
  using Load = std::function<LoadedScene(const FoundScene& found, const SceneForm& form)>;

  /// `load` is called on `loader`, and `changed` when there is a new poster. All outlive this
  /// object, and its tasks.
  ScenePosters(SceneShelf& shelf, SceneTrees& trees, SceneResidency& residency,
               boost::asio::io_context& io, boost::asio::thread_pool& loader, Load load,
               std::function<void()> changed)
      : shelf_(shelf),
        trees_(trees),
        residency_(residency),
        io_(io),
        loader_(loader),
        load_(std::move(load)),
        changed_(std::move(changed)) {}

  /// Does nothing if the poster is there or could not be made, while a visitor waits for a scene,
  /// or where the scene would not fit beside those in memory.
  void want(const std::string& id);
  [[nodiscard]] bool busy() const { return busy_; }

 private:
  void start(SceneBook& book, const SceneForm& form);

  SceneShelf& shelf_;
  SceneTrees& trees_;
  SceneResidency& residency_;
  boost::asio::io_context& io_;
  boost::asio::thread_pool& loader_;
  const Load load_;
  const std::function<void()> changed_;
  bool busy_ = false;
};

}  // namespace catgs
