#pragma once

#include <functional>
#include <string>
#include <utility>

#include "server/scenes/scene_index.h"
#include "server/scenes/scene_loader.h"
#include "server/scenes/scene_trees.h"

namespace catgs {

/// Brings the posters of scenes that are not in memory. Session thread only.
class ScenePosters {
 public:
  /// `load` loads a scene whose poster the cache does not have. `changed` is called when there is a
  /// new poster. All outlive this object, and its tasks.
  ScenePosters(SceneIndex& index, SceneTrees& trees, SceneLoader& loader,
               std::function<void(SceneRecord&)> load, std::function<void()> changed)
      : index_(index),
        trees_(trees),
        loader_(loader),
        load_(std::move(load)),
        changed_(std::move(changed)) {}

  /// Does nothing if the poster is there or could not be made, or while another one is read.
  void want(const std::string& id);

 private:
  SceneIndex& index_;
  SceneTrees& trees_;
  SceneLoader& loader_;
  const std::function<void(SceneRecord&)> load_;
  const std::function<void()> changed_;
  bool reads_ = false;
};

}  // namespace catgs
