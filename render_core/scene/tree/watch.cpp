#include "render_core/scene/tree/watch.h"

#include <algorithm>
#include <utility>

namespace catgs {
namespace {

bool same(const Camera& a, const Camera& b) {
  const Pose &at = a.world_from_camera, &bt = b.world_from_camera;
  return at.position == bt.position && at.orientation == bt.orientation && same_lens(a, b);
}

}  // namespace

bool ViewDemand::operator==(const ViewDemand& other) const {
  return detail_px == other.detail_px && at_once == other.at_once &&
         std::ranges::equal(cameras, other.cameras, same);
}

void Watch::look(ViewDemand demand) {
  {
    const std::lock_guard lock(mutex_);
    if (number_ > 0 && demand == demand_) return;
    demand_ = std::move(demand);
    ++number_;
  }
  wake_();
}

Watch::Numbered Watch::demand() const {
  const std::lock_guard lock(mutex_);
  return {demand_, number_};
}

void Watch::turned(std::uint64_t number, const Cut& cut, float budget_px, bool changes,
                   double now_s) {
  const std::lock_guard lock(mutex_);
  turned_ = number;
  progress_.missing = static_cast<std::uint32_t>(std::ranges::count_if(
      cut.missing, [=](const PageUse& use) { return use.typical_px > budget_px; }));
  progress_.coarsest_px = cut.missing.empty() ? 0.0f : cut.missing.front().error_px;
  changing_ = changes;
  if (!changes) return;
  ++progress_.changes;
  if (!demand_.at_once) blends_until_s_ = now_s + all_shown_s;
}

bool Watch::waits(double now_s) const {
  const std::lock_guard lock(mutex_);
  return turned_ != number_ || changing_ || now_s < blends_until_s_;
}

Watch::Progress Watch::progress() const {
  const std::lock_guard lock(mutex_);
  return progress_;
}

}  // namespace catgs
