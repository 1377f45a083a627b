#include "server/visit/admission_budget.h"

#include <algorithm>
#include <cmath>

namespace catgs {
namespace {

constexpr double fixed_work = 0.5;
constexpr double pixel_step = 9.0 / 16.0;  // three quarters of each side
/// The smallest picture that every session can be given. All waiting clients need about as much
/// room.
constexpr double least_megapixels = 1e-6 * 320 * 180;
/// Pixels are given back only up to this load. The rest keeps newcomers from taking them at once.
constexpr double growth_load = 0.9;

/// The next smaller picture.
double reduced(double megapixels) { return std::max(pixel_step * megapixels, least_megapixels); }
bool reducible(double megapixels) { return megapixels > least_megapixels; }

/// Sets the size of a session's pictures. Its cost follows by the work of a frame.
void resize(SessionDemand& session, double megapixels) {
  if (session.frame_cost) {
    const double factor = frame_work(megapixels) / frame_work(session.megapixels);
    session.frame_cost->cpu_seconds *= factor;
    session.frame_cost->gpu_seconds *= factor;
  }
  session.megapixels = megapixels;
}

/// Returns the sessions with a cost each. A session without a measured cost gets the mean of the
/// others, scaled by the work of a frame. Empty: nothing is measured.
std::vector<SessionDemand> with_costs(std::span<const SessionDemand> sessions) {
  SessionUsage::FrameCost measured;
  double measured_work = 0;
  for (const SessionDemand& session : sessions) {
    if (!session.frame_cost) continue;
    measured.cpu_seconds += session.frame_cost->cpu_seconds;
    measured.gpu_seconds += session.frame_cost->gpu_seconds;
    measured_work += frame_work(session.megapixels);
  }
  if (measured_work <= 0) return {};
  std::vector<SessionDemand> all(sessions.begin(), sessions.end());
  for (SessionDemand& session : all) {
    const double share = frame_work(session.megapixels) / measured_work;
    if (!session.frame_cost)
      session.frame_cost = {measured.cpu_seconds * share, measured.gpu_seconds * share};
  }
  return all;
}

}  // namespace

double frame_work(double megapixels) { return fixed_work + megapixels; }

AdmissionBudget::Load AdmissionBudget::load(std::span<const SessionDemand> sessions) const {
  SessionUsage::FrameCost demand;  // seconds of work in a second
  for (const SessionDemand& session : with_costs(sessions)) {
    const double rate = std::min(min_fps_, session.fps);
    demand.cpu_seconds += rate * session.frame_cost->cpu_seconds;
    demand.gpu_seconds += rate * session.frame_cost->gpu_seconds;
  }
  // Without a GPU that counts, none of its seconds are charged either.
  return {demand.cpu_seconds / capacity_.cpus,
          demand.gpu_seconds > 0 ? demand.gpu_seconds / capacity_.gpus : 0.0};
}

AdmissionBudget::Offer AdmissionBudget::offer(std::span<const SessionDemand> present,
                                              const SessionDemand& newcomer) const {
  if (min_fps_ == 0 || present.empty()) return {};
  if (std::ranges::none_of(present, [](const auto& s) { return s.frame_cost.has_value(); })) {
    const auto fresh = static_cast<double>(std::ranges::count_if(present, &SessionDemand::fresh));
    return {fresh < (capacity_.gpus > 0 ? capacity_.gpus : capacity_.cpus) ? Room::yes
                                                                           : Room::unknown};
  }
  std::vector<SessionDemand> all(present.begin(), present.end());
  all.push_back(newcomer);
  all = with_costs(all);
  while (total(all) > 1.0 && reducible(all.back().megapixels))
    resize(all.back(), reduced(all.back().megapixels));
  Offer offer{Room::yes, all.back().megapixels / newcomer.megapixels};
  if (total(all) <= 1.0) return offer;
  if (!make_room(all)) return {Room::no};
  for (std::size_t i = 0; i < present.size(); ++i)
    offer.kept.push_back(all[i].megapixels / present[i].megapixels);
  return offer;
}

bool AdmissionBudget::make_room(std::vector<SessionDemand>& sessions) const {
  const double equal_share = 1.0 / static_cast<double>(sessions.size());
  const auto load_of = [&](const SessionDemand& session) { return total(std::span(&session, 1)); };
  while (total(sessions) > 1.0) {
    SessionDemand* largest = nullptr;
    for (SessionDemand& session : sessions)
      if (reducible(session.megapixels) && load_of(session) > equal_share &&
          (!largest || load_of(session) > load_of(*largest)))
        largest = &session;
    if (!largest) return false;
    resize(*largest, reduced(largest->megapixels));
  }
  return true;
}

std::optional<AdmissionBudget::Growth> AdmissionBudget::growth(
    std::span<const SessionDemand> present) const {
  const SessionDemand* next = nullptr;
  for (const SessionDemand& session : present)
    if (session.pixel_share < 1.0 && (!next || session.megapixels < next->megapixels))
      next = &session;
  if (!next) return std::nullopt;
  const auto index = static_cast<std::size_t>(next - present.data());
  const double share = std::min(1.0, next->pixel_share / pixel_step);
  std::vector<SessionDemand> grown(present.begin(), present.end());
  resize(grown[index], next->megapixels * share / next->pixel_share);
  if (present.size() > 1 && total(grown) > growth_load) return std::nullopt;
  return Growth{index, share};
}

int AdmissionBudget::seats(std::span<const SessionDemand> present, int max_sessions) const {
  const double taken = total(present);
  if (min_fps_ == 0 || taken <= 0.0) return max_sessions;
  const double seats = std::floor(static_cast<double>(present.size()) / taken);
  return static_cast<int>(std::clamp(seats, 1.0, static_cast<double>(max_sessions)));
}

}  // namespace catgs
