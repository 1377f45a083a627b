#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/base/clock.h"

namespace catgs {

struct ResidencyLimits {
  std::uint64_t budget_bytes = 0;  // of all scenes in memory, on each device; 0: no bound
  /// The least time that a scene stays. Otherwise two visitors of different scenes could make the
  /// server reload them in turns.
  std::chrono::milliseconds min_residency{60'000};
};

/// Decides which scenes are in memory, which is loaded next and which are released for it. One
/// scene loads at a time and one may wait. Scenes in use are never released; of the others, the
/// least recently used goes first. Until a scene is loaded, its size is the one in its header.
/// Pure: time comes in, decisions come out. Not thread-safe.
class SceneResidency {
 public:
  /// True if a scene in memory is in use.
  using InUse = std::function<bool(const std::string& id)>;

  explicit SceneResidency(ResidencyLimits limits) : limits_(limits) {}

  /// Adds a scene that stays in memory for good.
  void pin(const std::string& id, std::uint64_t bytes);

  enum class Wish {
    resident,   // it is in memory
    awaited,    // it is being loaded, or next
    too_large,  // there will never be room for it
    no_room,    // those in memory are in use
    busy,       // one is being loaded and one waits
  };
  /// Requests a scene that needs `bytes`.
  Wish want(const std::string& id, std::uint64_t bytes, TimePoint now, const InUse& in_use);

  /// The next step for the waiting scene. Do `release` first, because it makes room.
  struct Step {
    std::vector<std::string> release;
    std::string load;
  };
  /// Returns nothing while a scene is loading, or while the scenes to release are too recent. The
  /// caller carries the step out and then calls loaded() or failed().
  std::optional<Step> next(TimePoint now, const InUse& in_use);

  void loaded(const std::string& id, std::uint64_t bytes, TimePoint now);
  void failed(const std::string& id);
  /// Removes a scene that is gone for another reason.
  void drop(const std::string& id) { residents_.erase(id); }
  /// Records that the scene is in use now.
  void note_use(const std::string& id, TimePoint now);

  [[nodiscard]] bool resident(const std::string& id) const { return residents_.contains(id); }
  [[nodiscard]] bool awaited(const std::string& id) const {
    return loading_ == id || (waiting_ && waiting_->id == id);
  }
  /// True while a scene is being loaded or waits for it.
  [[nodiscard]] bool busy() const { return !loading_.empty() || waiting_; }
  /// True if so many bytes fit without releasing a scene.
  [[nodiscard]] bool has_room(std::uint64_t bytes) const {
    return limits_.budget_bytes == 0 || this->bytes() + bytes <= limits_.budget_bytes;
  }
  [[nodiscard]] std::uint64_t bytes() const;
  [[nodiscard]] std::size_t count() const { return residents_.size(); }

 private:
  struct Resident {
    std::uint64_t bytes = 0;
    bool pinned = false;
    TimePoint since;
    TimePoint last_use;
  };
  struct Waiting {
    std::string id;
    std::uint64_t bytes = 0;
  };
  /// The least recently used scenes to release for `bytes`, if `may_go` permits enough of them.
  /// Empty if there is room already.
  [[nodiscard]] std::optional<std::vector<std::string>> room_for(
      std::uint64_t bytes,
      const std::function<bool(const std::string&, const Resident&)>& may_go) const;

  const ResidencyLimits limits_;
  std::map<std::string, Resident> residents_;
  std::string loading_;
  std::optional<Waiting> waiting_;
};

}  // namespace catgs
