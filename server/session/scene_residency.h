#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

struct ResidencyLimits {
  std::uint64_t budget_bytes = 0;  // of all scenes in memory, on each device; 0: no bound
  /// A scene stays at least so long, so that two visitors of different ones do not make the server
  /// load them in turns.
  std::chrono::milliseconds min_residency{60'000};
};

/// Which scenes are in memory, which one comes next and which ones go for it. One is loaded at a
/// time and one waits for that; scenes in use never go, of the others the least recently used one
/// first. Pure: time comes in, decisions come out. Sizes are those that headers announce until a
/// scene is loaded. Not thread-safe.
class SceneResidency {
 public:
  /// Whether somebody uses a scene that is in memory.
  using InUse = std::function<bool(const std::string& id)>;

  explicit SceneResidency(ResidencyLimits limits) : limits_(limits) {}

  /// A scene that is in memory and stays there for good.
  void pin(const std::string& id, std::uint64_t bytes);

  enum class Wish {
    resident,   // it is in memory
    awaited,    // it is being loaded, or next
    too_large,  // there will never be room for it
    no_room,    // those in memory are in use
    busy,       // one is being loaded and one waits
  };
  /// Somebody wants to see the scene, which needs `bytes`.
  Wish want(const std::string& id, std::uint64_t bytes, TimePoint now, const InUse& in_use);

  /// What to do about the scene that waits. `release` first: that is what makes room.
  struct Step {
    std::vector<std::string> release;
    std::string load;
  };
  /// Nothing while one is being loaded, or while those that would have to go came too recently.
  /// The caller does as it says and then calls loaded() or failed().
  std::optional<Step> next(TimePoint now, const InUse& in_use);

  void loaded(const std::string& id, std::uint64_t bytes, TimePoint now);
  void failed(const std::string& id);
  /// A scene is gone for another reason.
  void drop(const std::string& id) { residents_.erase(id); }
  /// The scene was in use just now.
  void note_use(const std::string& id, TimePoint now);

  [[nodiscard]] bool resident(const std::string& id) const { return residents_.contains(id); }
  [[nodiscard]] bool awaited(const std::string& id) const {
    return loading_ == id || (waiting_ && waiting_->id == id);
  }
  [[nodiscard]] std::uint64_t bytes() const;
  [[nodiscard]] std::size_t count() const { return residents_.size(); }

 private:
  struct Resident {
    std::uint64_t bytes = 0;
    bool pinned = false;
    TimePoint since{};
    TimePoint last_use{};
  };
  struct Waiting {
    std::string id;
    std::uint64_t bytes = 0;
  };
  /// The least recently used that have to go for `bytes`, if `may_go` lets enough of them; empty
  /// when there is room as it is.
  [[nodiscard]] std::optional<std::vector<std::string>> room_for(
      std::uint64_t bytes,
      const std::function<bool(const std::string&, const Resident&)>& may_go) const;

  const ResidencyLimits limits_;
  std::map<std::string, Resident> residents_;
  std::string loading_;
  std::optional<Waiting> waiting_;
};

}  // namespace catgs
