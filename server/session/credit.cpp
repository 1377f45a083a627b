#include "server/session/credit.h"

#include <algorithm>

namespace catgs {
namespace {

using std::chrono::microseconds;
constexpr std::chrono::seconds rtt_span{5};
constexpr std::int64_t max_in_flight = 8;

}  // namespace

void CreditWindow::sent(std::uint64_t frame_id, TimePoint now) {
  in_flight_.push_back({frame_id, now});
}

void CreditWindow::lost(std::uint64_t frame_id) {
  std::erase_if(in_flight_, [&](const InFlight& f) { return f.frame_id == frame_id; });
}

bool CreditWindow::acknowledged(std::uint64_t frame_id, bool dropped, TimePoint now) {
  const auto it = std::ranges::find(in_flight_, frame_id, &InFlight::frame_id);
  if (it == in_flight_.end()) return false;
  if (dropped) {
    in_flight_.erase(it);
    return true;
  }
  measure(std::chrono::duration_cast<microseconds>(now - it->sent), now);
  in_flight_.erase(in_flight_.begin(), it + 1);
  return true;
}

int CreditWindow::limit() const {
  const auto rtt = base_rtt().count();
  const auto interval = std::max<std::int64_t>(1, frame_interval_.count());
  const auto frames = (rtt + interval - 1) / interval + 1;
  return static_cast<int>(std::clamp<std::int64_t>(frames, 1, max_in_flight));
}

microseconds CreditWindow::base_rtt() const {
  if (previous_span_min_.count() == 0) return span_min_;
  if (span_min_.count() == 0) return previous_span_min_;
  return std::min(span_min_, previous_span_min_);
}

void CreditWindow::measure(microseconds rtt, TimePoint now) {
  if (now - span_start_ >= rtt_span) {
    // After a silence of a whole span the older minimum says nothing about today's path.
    previous_span_min_ = now - span_start_ < 2 * rtt_span ? span_min_ : microseconds{0};
    span_min_ = microseconds{0};
    span_start_ = now;
  }
  rtt = std::max(rtt, microseconds{1});
  span_min_ = span_min_.count() == 0 ? rtt : std::min(span_min_, rtt);
}

}  // namespace catgs
