#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/base/clock.h"
#include "server/scenes/scene_lease.h"

namespace catgs {

struct ResidencyLimits {
  std::uint64_t budget_bytes = 0;  // of all scenes in memory, on each device; 0: no bound
  std::uint64_t pool_bytes = 0;    // a part of it, that all scenes in pages share
  /// The least time that a scene stays. Otherwise two visitors of different scenes could make the
  /// server reload them in turns.
  std::chrono::milliseconds min_residency{60'000};
};

/// The memory that a scene takes on each device: so many bytes, or a share of the pool of pages.
struct SceneNeed {
  SceneNeed(std::uint64_t of_bytes, bool is_in_pages = false)  // NOLINT: bytes are a need
      : bytes(is_in_pages ? 0 : of_bytes), in_pages(is_in_pages) {}

  /// That of two representations of one scene.
  [[nodiscard]] SceneNeed with(const SceneNeed& other) const {
    SceneNeed both = *this;
    both.bytes += other.bytes;
    both.in_pages |= other.in_pages;
    return both;
  }

  std::uint64_t bytes;
  bool in_pages;
};

/// Scenes in pages that are in memory at a time. Each holds an open file, and some host memory.
inline constexpr std::size_t most_scenes_in_pages = 32;

/// Decides which scenes are in memory, which is loaded next and which are released for it. One
/// scene loads at a time and one may wait. Scenes that visitors use are never released; of the
/// others, the least recently used goes first. Background jobs let go of a scene before it is
/// released. Until a scene is loaded, its size is the one in its header. The first scene in pages
/// takes the whole pool, and the others nothing beside it.
/// Pure: time comes in, decisions come out. Not thread-safe.
class SceneResidency {
 public:
  /// The users of a scene in memory.
  using UseOf = std::function<SceneUse(const std::string& id)>;

  explicit SceneResidency(ResidencyLimits limits) : limits_(limits) {}

  /// Adds a scene that stays in memory for good.
  void pin(const std::string& id, const SceneNeed& need);

  enum class Answer {
    resident,   // it is in memory
    awaited,    // it is being loaded, or next
    too_large,  // there will never be room for it
    no_room,    // visitors look at those in memory
    busy,       // one is being loaded and one waits
  };
  Answer want(const std::string& id, const SceneNeed& need, TimePoint now, const UseOf& use_of);

  /// The next step for the waiting scene. Do `release` first, because it makes room.
  struct Step {
    std::vector<std::string> release;
    std::string load;
    std::vector<std::string> recall{};  // from background jobs; ask for a step again afterwards
  };
  /// Returns nothing while a scene is loading, or while the scenes to release are too recent. The
  /// caller carries the step out and then calls loaded() or failed(), unless it is to recall.
  std::optional<Step> next(TimePoint now, const UseOf& use_of);
  /// The step that loads a scene for a background job; nothing: not now. It is no step for scenes
  /// that visitors wait for, and it releases none that anybody has used within the least time that
  /// scenes stay.
  std::optional<Step> next_in_background(const std::string& id, const SceneNeed& need,
                                         TimePoint now, const UseOf& use_of);

  void loaded(const std::string& id, const SceneNeed& need, TimePoint now);
  void failed(const std::string& id);
  /// Removes a scene that is gone for another reason.
  void drop(const std::string& id) { residents_.erase(id); }
  /// Updates the scene's memory size.
  void resize(const std::string& id, const SceneNeed& need) { residents_.at(id).need = need; }
  /// Records that the scene is in use now.
  void note_use(const std::string& id, TimePoint now);

  [[nodiscard]] bool resident(const std::string& id) const { return residents_.contains(id); }
  [[nodiscard]] bool awaited(const std::string& id) const {
    return loading_ == id || (waiting_ && waiting_->id == id);
  }
  /// True while a scene is being loaded or waits for it.
  [[nodiscard]] bool busy() const { return !loading_.empty() || waiting_; }
  /// True while a scene is being loaded that no visitor waits for.
  [[nodiscard]] bool loads_in_background() const { return in_background_; }
  /// True while a visitor waits for a scene that is not being loaded yet.
  [[nodiscard]] bool visitor_waits() const { return waiting_.has_value(); }
  /// True if it fits without releasing a scene.
  [[nodiscard]] bool has_room(const SceneNeed& need) const { return fits({}, need); }
  /// True if it fits when all scenes have left that may leave.
  [[nodiscard]] bool could_fit(const SceneNeed& need) const {
    return room_for(need, [](const auto&, const Resident&) { return true; }).has_value();
  }
  [[nodiscard]] std::uint64_t bytes() const;
  [[nodiscard]] std::size_t count() const { return residents_.size(); }

 private:
  struct Resident {
    SceneNeed need;
    bool pinned;
    TimePoint since;
    TimePoint last_use;
  };
  struct Waiting {
    std::string id;
    SceneNeed need;
  };
  /// The memory of the scenes but for those that are `gone`.
  [[nodiscard]] std::uint64_t bytes_without(const std::vector<std::string>& gone,
                                            bool pool_stays) const;
  Step begin(const std::string& id, std::vector<std::string> release, bool in_background);
  /// Whether a scene fits when those are `gone`.
  [[nodiscard]] bool fits(const std::vector<std::string>& gone, const SceneNeed& need) const;
  /// The least recently used scenes to release for a scene, if `may_go` permits enough of them.
  /// Empty if there is room already.
  [[nodiscard]] std::optional<std::vector<std::string>> room_for(
      const SceneNeed& need,
      const std::function<bool(const std::string&, const Resident&)>& may_go) const;

  const ResidencyLimits limits_;
  std::map<std::string, Resident> residents_;
  std::string loading_;
  bool in_background_ = false;  // loading_ is for a job that nobody waits for
  std::optional<Waiting> waiting_;
};

}  // namespace catgs
