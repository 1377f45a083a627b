#pragma once

#include <functional>
#include <string>

#include "server/scenes/scene_index.h"
#include "server/scenes/scene_loader.h"
#include "server/scenes/scene_residency.h"
#include "server/scenes/scene_trees.h"

namespace catgs {

/// Loads scenes for a moment to make their posters, one at a time. Session thread only.
class ScenePosters {
 public:
  /// `changed` is called when there is a new poster. All outlive this object, and its tasks.
  ScenePosters(SceneIndex& index, SceneTrees& trees, SceneResidency& residency, SceneLoader& loader,
               std::function<void()> changed)
      : index_(index),
        trees_(trees),
        residency_(residency),
        loader_(loader),
        changed_(std::move(changed)) {}

  /// Does nothing if the poster is there or could not be made, while a visitor waits for a scene,
  /// or where the scene would not fit beside those in memory.
  void want(const std::string& id);
  [[nodiscard]] bool busy() const { return busy_; }

 private:
  void start(SceneRecord& record, const SceneRepresentation& representation);

  SceneIndex& index_;
  SceneTrees& trees_;
  SceneResidency& residency_;
  SceneLoader& loader_;
  const std::function<void()> changed_;
  bool busy_ = false;
};

}  // namespace catgs
