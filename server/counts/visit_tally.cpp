#include "server/counts/visit_tally.h"

#include <chrono>
#include <utility>

namespace catgs {

void VisitTally::on_show(const std::string& scene_id, DeviceKind device, std::uint64_t bytes_sent,
                         TimePoint now) {
  if (!counts_) return;
  if (scene_id != scene_id_) {
    counts_->visit(scene_id, device);
    scene_id_ = scene_id;
    stops_.clear();
  }
  const auto since = std::exchange(seen_at_, now).value_or(now);
  const std::uint64_t before = std::exchange(bytes_sent_, bytes_sent);
  counts_->spend(scene_id, std::chrono::duration<double>(now - since).count(), bytes_sent - before);
}

void VisitTally::reached(StopId stop) {
  if (!counts_ || scene_id_.empty() || stops_.size() >= VisitCounts::most_stops) return;
  if (stops_.insert(stop).second) counts_->reach(scene_id_, stop);
}

}  // namespace catgs
