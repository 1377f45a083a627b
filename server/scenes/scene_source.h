#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/base/clock.h"
#include "server/net/messages.h"

namespace catgs {

struct SceneEntry;

/// The scene is being loaded. Ask again.
struct SceneAwaited {
  std::chrono::seconds estimate{};
};

using SceneAnswer = std::variant<std::shared_ptr<const SceneEntry>, SceneAwaited, ErrorMessage>;

/// Provides scenes to visits. Session thread only.
class SceneSource {
 public:
  virtual ~SceneSource() = default;
  /// The first is for clients that name none.
  [[nodiscard]] virtual std::vector<std::string> scene_ids() const = 0;
  /// Resolves a name to a scene's id. A name that stands for no scene or for several is returned
  /// unchanged.
  [[nodiscard]] virtual std::string resolve(std::string_view name) const {
    return std::string(name);
  }
  [[nodiscard]] virtual bool has(const std::string& id) const = 0;
  /// Requests a scene for a client that may see it. The scene stays in memory as long as its entry
  /// is held.
  virtual SceneAnswer want(const std::string& id, TimePoint now) = 0;
  /// Somebody may want the scene soon. It is loaded where that costs nobody another scene.
  virtual void prepare(const std::string& /*id*/, TimePoint /*now*/) {}
  /// The entry that replaces one that a visitor sees, of the same scene in another representation;
  /// null: it stays.
  [[nodiscard]] virtual std::shared_ptr<const SceneEntry> newer_representation(
      const SceneEntry& /*seen*/) {
    return nullptr;
  }
  /// Call it at least four times a second.
  virtual void on_tick(TimePoint now) = 0;
};

}  // namespace catgs
