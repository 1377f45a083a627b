#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/clock.h"
#include "server/scenes/scene_index.h"
#include "server/scenes/scene_loader.h"
#include "server/scenes/scene_residency.h"
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
  /// All outlive this object, and its tasks.
  SceneRedrawing(SceneIndex& index, SceneTrees& trees, SceneResidency& residency,
                 SceneLoader& loader)
      : index_(index), trees_(trees), residency_(residency), loader_(loader) {}

  struct Tick {
    std::vector<std::string>
        too_large;         // ids of unused scenes whose two representations do not fit together
    bool changed = false;  // the listing has
  };
  Tick on_tick(TimePoint now);

  /// True while a scene takes the memory of two representations. One of them goes soon.
  [[nodiscard]] bool holds_two_representations() const;
  /// Ends a load that is not for visitors. It is tried again later.
  void give_way() { loader_.cancel(gives_way_); }

  /// See SceneSource.
  [[nodiscard]] std::shared_ptr<const SceneEntry> newer_representation(
      const SceneEntry& seen) const;

 private:
  void start(const std::string& id);
  void on_loaded(const std::string& id, const FoundScene& found, LoadedScene loaded,
                 const std::shared_ptr<Renderer>& before);

  SceneIndex& index_;
  SceneTrees& trees_;
  SceneResidency& residency_;
  SceneLoader& loader_;
  bool busy_ = false;
  Background::JobId gives_way_ = 0;    // the last such load
  bool gave_way_ = false;              // since the last tick
  std::optional<TimePoint> retry_at_;  // after it gave way
  bool changed_ = false;               // the listing, since the last tick
};

}  // namespace catgs
