#pragma once

#include <atomic>
#include <memory>
#include <utility>

#include "server/scenes/scene_entry.h"

namespace catgs {

/// The users of a scene in memory.
enum class SceneUse { none, background, visitors };

/// A scene in memory and the background jobs that hold it share this. Thread-safe.
struct SceneLeases {
  std::atomic<int> held{0};
  std::atomic<int> recalls{0};
};

/// A background job's hold on a scene in memory. Visitors of other scenes come first: once it is
/// recalled, the job lets go between two pictures. It may then ask for another lease.
class SceneLease {
 public:
  /// `content` counts the contents that the scene's file has had.
  SceneLease(std::shared_ptr<Renderer> renderer, std::shared_ptr<SceneLeases> leases, int content)
      : renderer_(std::move(renderer)),
        leases_(std::move(leases)),
        recalls_(leases_->recalls),
        content_(content) {
    ++leases_->held;
  }
  ~SceneLease() {
    renderer_.reset();
    --leases_->held;
  }
  SceneLease(const SceneLease&) = delete;
  SceneLease& operator=(const SceneLease&) = delete;

  /// Any thread.
  [[nodiscard]] bool recalled() const { return leases_->recalls != recalls_; }
  [[nodiscard]] int content() const { return content_; }
  [[nodiscard]] Renderer* renderer() const { return renderer_.get(); }

 private:
  std::shared_ptr<Renderer> renderer_;
  const std::shared_ptr<SceneLeases> leases_;
  const int recalls_, content_;
};

/// A scene as a background job sees it.
struct LeasedScene {
  std::shared_ptr<const SceneLease> lease{};  // null: not now
  std::shared_ptr<const SceneEntry> entry{};  // it, and copies of it, hold the lease
  bool gone = false;                          // the scene is offered no more
};

/// Leases `entry`, whose renderer is counted once, whatever the job copies.
inline LeasedScene leased(const SceneEntry& entry, std::shared_ptr<SceneLeases> leases,
                          int content) {
  auto lease = std::make_shared<const SceneLease>(entry.renderer, std::move(leases), content);
  auto scene = std::make_shared<SceneEntry>(entry);
  scene->renderer = std::shared_ptr<Renderer>(lease, lease->renderer());
  return {std::move(lease), std::move(scene)};
}

/// `entry` without the lease that it may hold. `renderer` is the same one, not leased.
inline std::shared_ptr<const SceneEntry> unleased(std::shared_ptr<const SceneEntry> entry,
                                                  const std::shared_ptr<Renderer>& renderer) {
  const bool shares_owner =
      !renderer.owner_before(entry->renderer) && !entry->renderer.owner_before(renderer);
  if (shares_owner) return entry;
  auto scene = std::make_shared<SceneEntry>(*entry);
  scene->renderer = renderer;
  return scene;
}

}  // namespace catgs
