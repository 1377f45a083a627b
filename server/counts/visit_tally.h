#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>

#include "server/base/clock.h"
#include "server/counts/visit_counts.h"

namespace catgs {

/// Counts one visit. Where its visitor goes to another scene, that is a visit of that scene. Not
/// thread-safe.
class VisitTally {
 public:
  /// `counts`: null where visits are not counted. It outlives the tally.
  explicit VisitTally(VisitCounts* counts) : counts_(counts) {}

  /// Call it often while the visitor sees the scene. `bytes_sent`: in the whole visit so far.
  /// `link_id`: by which the visitor came; empty: by none.
  void on_show(const std::string& scene_id, DeviceKind device, std::uint64_t bytes_sent,
               TimePoint now, const std::string& link_id = {});
  /// The visitor sees nothing for a while.
  void off_show() { seen_at_.reset(); }
  /// A stop of the scene counts once in a visit, however often it is reached.
  void reached(const std::string& scene_id, DeviceKind device, StopId stop,
               const std::string& link_id = {});

 private:
  void enter(const std::string& scene_id, DeviceKind device, const std::string& link_id);

  VisitCounts* const counts_;
  std::string scene_id_;
  std::optional<TimePoint> seen_at_;
  std::uint64_t bytes_sent_ = 0;
  std::set<StopId> stops_;
};

}  // namespace catgs
