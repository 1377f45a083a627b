#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/clock.h"
#include "server/base/page_metrics.h"
#include "server/scenes/scene_entry.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/scene_lease.h"
#include "server/scenes/walkable_areas.h"

namespace catgs {

/// One scene in the listing for pages that offer scenes.
struct SceneListing {
  std::string id;
  std::string title;
  std::uint64_t gaussians = 0;
  SceneAbout about{};
  bool loaded = false;
  std::string state{};                          // for people: "building tree 37 %"; often empty
  std::optional<ToursAnswers> tours{};          // of a loaded one
  std::filesystem::path sidecar{};              // of a loaded one; empty: it is no file
  std::shared_ptr<const std::string> poster{};  // of one that has been loaded; a JPEG file
  std::shared_ptr<const WalkableArea> walkable_area{};  // of a loaded one; null: not known yet
};

/// A scene that the server offers, as far as it is known.
struct SceneRecord {
  FoundScene found;  // of procedural scenes, only location.given, name and size are set
  std::shared_ptr<const SceneEntry> entry;      // while in memory
  std::shared_ptr<const SceneEntry> former{};   // drawn before `entry`; while visitors still see it
  std::shared_ptr<const std::string> poster{};  // stays when the entry goes
  bool poster_tried = false;                    // for this content of the file
  std::shared_ptr<const WalkableArea> walkable_area{};  // of the entry; null: not known yet
  std::optional<TimePoint> walkable_area_retry_at{};    // after a failure to find it
  bool pinned = false;
  bool outdated = false;                // the file has changed since
  bool tree_lost = false;               // the entry reads a tree with damage: another is built
  bool gone = false;                    // the file is gone: not offered any more
  bool told = false;                    // the log has named its path, as others share its name
  std::optional<TimePoint> retry_at{};  // after a failure
  int content = 0;                      // counts the contents that the file has had
  std::shared_ptr<SceneLeases> leases = std::make_shared<SceneLeases>();

  /// Scenes come into use on the session thread only, so an unused scene stays unused. Uses may end
  /// elsewhere without harm.
  [[nodiscard]] SceneUse use() const;
  /// True if only the index holds the former entry.
  [[nodiscard]] bool former_is_left() const { return former && !held(former, 0); }
  /// A background job's hold on the entry.
  [[nodiscard]] LeasedScene lease() const {
    return leased(*entry, leases, outdated ? content - 1 : content);
  }
  /// Background jobs let go of the scene soon.
  void recall() const { ++leases->recalls; }

 private:
  /// True if a user besides the index and so many leases holds the scene.
  static bool held(const std::shared_ptr<const SceneEntry>& entry, int leases) {
    return entry && (entry.use_count() > 1 || entry->renderer.use_count() > 1 + leases);
  }
};

/// The scenes that a server offers, by id and by name, and their listing. All functions run on the
/// session thread unless marked.
class SceneIndex {
 public:
  using Records = std::map<std::string, SceneRecord>;
  [[nodiscard]] Records& records() { return records_; }
  [[nodiscard]] const Records& records() const { return records_; }
  /// Null: there is none.
  [[nodiscard]] SceneRecord* find(const std::string& id);
  /// Returns the record with this id and creates it if needed.
  SceneRecord& record_of(const std::string& id);
  /// Takes over the result of a scan. Records of scenes that are gone are removed, unless they are
  /// in memory or `awaited`.
  void merge(std::vector<FoundScene> found,
             const std::function<bool(const std::string& id)>& awaited);

  /// Makes a scene the default one while its file exists. Empty: none was named.
  void prefer(const std::string& id) { preferred_ = id; }
  [[nodiscard]] const std::string& preferred() const { return preferred_; }
  [[nodiscard]] std::vector<std::string> scene_ids() const;
  /// Any thread. Returns the id of the only scene with this name, or else the name itself. If two
  /// paths have had the name since the start, it stands for neither, because a link by name does
  /// not tell them apart.
  [[nodiscard]] std::string resolve(std::string_view name) const;

  /// The pages of trees that are in memory.
  [[nodiscard]] std::vector<ScenePages> pages() const;
  /// Updates listing(). `state_of`: what is done for a scene at the moment, for people.
  void publish(const std::function<std::string(const FoundScene&)>& state_of);
  /// Any thread.
  [[nodiscard]] std::shared_ptr<const std::vector<SceneListing>> listing() const;

 private:
  Records records_;
  std::string preferred_;
  mutable std::mutex published_mutex_;  // guards the next two
  std::shared_ptr<const std::vector<SceneListing>> published_;
  std::map<std::string, std::string, std::less<>>
      by_name_;  // name to id; empty: two scenes have had the name
};

}  // namespace catgs
