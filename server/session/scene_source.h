#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "server/net/messages.h"
#include "server/pipeline/frame_ticket.h"

namespace catgs {

struct SceneEntry;

/// The scene is not in memory yet, but on its way there: ask again.
struct SceneAwaited {
  std::chrono::seconds estimate{};
};

using SceneAnswer = std::variant<std::shared_ptr<const SceneEntry>, SceneAwaited, ErrorMessage>;

/// Where sessions get their scenes from. Session thread only.
class SceneSource {
 public:
  virtual ~SceneSource() = default;
  /// For clients that name none.
  [[nodiscard]] virtual std::string default_scene() const = 0;
  [[nodiscard]] virtual std::vector<std::string> scene_ids() const = 0;
  [[nodiscard]] virtual bool has(const std::string& id) const = 0;
  /// Somebody who may see it wants to. As long as a scene is held it stays in memory.
  virtual SceneAnswer want(const std::string& id, TimePoint now) = 0;
  /// At least four times a second.
  virtual void on_tick(TimePoint now) = 0;
};

}  // namespace catgs
