#include "server/session/admission_budget.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace catgs {

AdmissionBudget::Load AdmissionBudget::load(std::span<const SessionDemand> sessions) const {
  SessionUsage::FrameCost measured;
  double measured_megapixels = 0;
  for (const SessionDemand& session : sessions) {
    if (!session.frame_cost) continue;
    measured.cpu_seconds += session.frame_cost->cpu_seconds;
    measured.gpu_seconds += session.frame_cost->gpu_seconds;
    measured_megapixels += session.megapixels;
  }
  if (measured_megapixels <= 0) return {};

  SessionUsage::FrameCost demand;  // seconds of work in a second
  for (const SessionDemand& session : sessions) {
    const double rate = std::min(min_fps_, session.fps);
    const double share = session.megapixels / measured_megapixels;
    const auto cost = session.frame_cost.value_or(
        SessionUsage::FrameCost{measured.cpu_seconds * share, measured.gpu_seconds * share});
    demand.cpu_seconds += rate * cost.cpu_seconds;
    demand.gpu_seconds += rate * cost.gpu_seconds;
  }
  // Without a GPU that counts, none of its seconds are charged either.
  return {demand.cpu_seconds / capacity_.cpus,
          demand.gpu_seconds > 0 ? demand.gpu_seconds / capacity_.gpus : 0.0};
}

Room AdmissionBudget::room(std::span<const SessionDemand> present,
                           const SessionDemand& newcomer) const {
  if (min_fps_ == 0 || present.empty()) return Room::yes;
  if (std::ranges::none_of(present, [](const auto& s) { return s.frame_cost.has_value(); })) {
    const auto fresh = static_cast<double>(std::ranges::count_if(present, &SessionDemand::fresh));
    return fresh < (capacity_.gpus > 0 ? capacity_.gpus : capacity_.cpus) ? Room::yes
                                                                          : Room::unknown;
  }
  std::vector<SessionDemand> all(present.begin(), present.end());
  all.push_back(newcomer);
  const Load taken = load(all);
  return taken.cpus <= 1.0 && taken.gpus <= 1.0 ? Room::yes : Room::no;
}

int AdmissionBudget::seats(std::span<const SessionDemand> present, int max_sessions) const {
  const Load taken = load(present);
  const double fullest = std::max(taken.cpus, taken.gpus);
  if (min_fps_ == 0 || fullest <= 0.0) return max_sessions;
  const double seats = std::floor(static_cast<double>(present.size()) / fullest);
  return static_cast<int>(std::clamp(seats, 1.0, static_cast<double>(max_sessions)));
}

}  // namespace catgs
