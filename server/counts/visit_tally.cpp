#include "server/counts/visit_tally.h"

#include <chrono>
#include <utility>

namespace catgs {

void VisitTally::enter(const std::string& scene_id, DeviceKind device, const std::string& link_id) {
  if (scene_id == scene_id_) return;
  counts_->visit(scene_id, device, link_id);
  scene_id_ = scene_id;
  stops_.clear();
}

void VisitTally::on_show(const std::string& scene_id, DeviceKind device, std::uint64_t bytes_sent,
                         TimePoint now, const std::string& link_id) {
  if (!counts_) return;
  enter(scene_id, device, link_id);
  const auto since = std::exchange(seen_at_, now).value_or(now);
  const std::uint64_t before = std::exchange(bytes_sent_, bytes_sent);
  counts_->spend(scene_id, std::chrono::duration<double>(now - since).count(), bytes_sent - before);
}

void VisitTally::reached(const std::string& scene_id, DeviceKind device, StopId stop,
                         const std::string& link_id) {
  if (!counts_) return;
  enter(scene_id, device, link_id);
  if (stops_.insert(stop).second) counts_->reach(scene_id, stop);
}

}  // namespace catgs
