#include "server/session/admission_budget.h"

#include <algorithm>

namespace catgs {

bool AdmissionBudget::has_room(std::span<const SessionDemand> present,
                               const SessionDemand& newcomer) const {
  if (min_fps_ == 0 || present.empty()) return true;
  SessionUsage::FrameCost measured;
  double measured_megapixels = 0;
  for (const SessionDemand& session : present) {
    if (!session.frame_cost) continue;
    measured.cpu_seconds += session.frame_cost->cpu_seconds;
    measured.gpu_seconds += session.frame_cost->gpu_seconds;
    measured_megapixels += session.megapixels;
  }
  if (measured_megapixels <= 0) return true;

  SessionUsage::FrameCost demand;  // seconds of work in a second
  const auto add = [&](const SessionDemand& session) {
    const double rate = std::min(min_fps_, session.fps);
    const double share = session.megapixels / measured_megapixels;
    const auto cost = session.frame_cost.value_or(
        SessionUsage::FrameCost{measured.cpu_seconds * share, measured.gpu_seconds * share});
    demand.cpu_seconds += rate * cost.cpu_seconds;
    demand.gpu_seconds += rate * cost.gpu_seconds;
  };
  for (const SessionDemand& session : present) add(session);
  add(newcomer);
  return demand.cpu_seconds <= capacity_.cpus &&
         (demand.gpu_seconds == 0 || demand.gpu_seconds <= capacity_.gpus);
}

}  // namespace catgs
