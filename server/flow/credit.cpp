#include "server/flow/credit.h"

#include <algorithm>

namespace catgs {
namespace {

using std::chrono::microseconds;
constexpr std::int64_t max_in_flight = 8;
// The slack of the byte bound: acknowledgements may wait for a display's refresh.
constexpr microseconds slack{20'000};
constexpr double excess_smoothing = 1.0 / 16.0;

}  // namespace

void CreditWindow::sent(const InFlight& frame) { in_flight_.push_back(frame); }

void CreditWindow::lost(std::uint64_t frame_id) {
  std::erase_if(in_flight_, [&](const InFlight& f) { return f.frame_id == frame_id; });
}

std::optional<CreditWindow::Settled> CreditWindow::acknowledged(std::uint64_t frame_id,
                                                                bool dropped, TimePoint now) {
  const auto it = std::ranges::find(in_flight_, frame_id, &InFlight::frame_id);
  if (it == in_flight_.end()) return std::nullopt;
  Settled settled;
  settled.frame = *it;
  settled.round_trip =
      std::max(std::chrono::duration_cast<microseconds>(now - it->sent), microseconds{1});
  const auto first = dropped ? it : in_flight_.begin();
  for (auto f = first; f != it + 1; ++f) {
    settled.bytes += f->bytes;
    settled.pixels += f->pixels;
  }
  if (!dropped) {
    rtt_us_.add(settled.round_trip.count(), now);
    const auto excess = settled.round_trip - base_rtt();
    excess_us_ += excess_smoothing * (static_cast<double>(excess.count()) - excess_us_);
  }
  in_flight_.erase(first, it + 1);
  return settled;
}

std::size_t CreditWindow::bytes_in_flight() const {
  std::size_t bytes = 0;
  for (const InFlight& frame : in_flight_) bytes += frame.bytes;
  return bytes;
}

int CreditWindow::limit() const {
  const auto rtt = usual_rtt().count();
  const auto interval = std::max<std::int64_t>(1, frame_interval_.count());
  const auto frames = (rtt + interval - 1) / interval + 1;
  return static_cast<int>(std::clamp<std::int64_t>(frames, 1, max_in_flight));
}

bool CreditWindow::available() const {
  if (in_flight_.empty()) return true;
  if (in_flight() >= limit()) return false;
  if (!bits_per_s_) return true;
  const std::chrono::duration<double> span = usual_rtt() + frame_interval_ + slack;
  return static_cast<double>(bytes_in_flight()) * 8.0 <= *bits_per_s_ * span.count();
}

microseconds CreditWindow::usual_rtt() const {
  return base_rtt() +
         std::min(microseconds(static_cast<std::int64_t>(excess_us_)), 2 * frame_interval_);
}

microseconds CreditWindow::base_rtt() const { return microseconds(rtt_us_.value().value_or(0)); }

}  // namespace catgs
