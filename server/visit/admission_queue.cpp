#include "server/visit/admission_queue.h"

#include <algorithm>

namespace catgs {

std::optional<int> AdmissionQueue::join(const std::string& session_id, TimePoint now) {
  auto it = std::ranges::find(waiting_, session_id, &Waiting::session_id);
  if (it == waiting_.end()) {
    if (waiting_.size() >= limit_) return std::nullopt;
    it = waiting_.insert(it, {session_id, now});
  }
  return static_cast<int>(it - waiting_.begin()) + 1;
}

void AdmissionQueue::leave(std::string_view session_id) {
  std::erase_if(waiting_, [&](const Waiting& w) { return w.session_id == session_id; });
}

void AdmissionQueue::session_ended(std::chrono::duration<double> lifetime) {
  constexpr double weight = 1.0 / 16.0;
  mean_lifetime_ += (lifetime - mean_lifetime_) * weight;
}

std::chrono::seconds AdmissionQueue::estimate(int position, int slots) const {
  return std::chrono::ceil<std::chrono::seconds>(mean_lifetime_ * position / std::max(1, slots));
}

}  // namespace catgs
