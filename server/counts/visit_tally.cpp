#include "server/counts/visit_tally.h"

#include <chrono>
#include <utility>

namespace catgs {

void VisitTally::enter(const std::string& scene_id, DeviceKind device) {
  if (scene_id == scene_id_) return;
  counts_->visit(scene_id, device);
  scene_id_ = scene_id;
  stops_.clear();
}

void VisitTally::on_show(const std::string& scene_id, DeviceKind device, std::uint64_t bytes_sent,
                         TimePoint now) {
  if (!counts_) return;
  enter(scene_id, device);
  const auto since = std::exchange(seen_at_, now).value_or(now);
  const std::uint64_t before = std::exchange(bytes_sent_, bytes_sent);
  counts_->spend(scene_id, std::chrono::duration<double>(now - since).count(), bytes_sent - before);
}

void VisitTally::reached(const std::string& scene_id, DeviceKind device, StopId stop) {
  if (!counts_) return;
  enter(scene_id, device);
  if (stops_.insert(stop).second) counts_->reach(scene_id, stop);
}

}  // namespace catgs
