#include "tests/load/tcp_window.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace catgs::load {
namespace {

constexpr double cubic = 0.4;  // C: segments a second cubed
constexpr double kept_after_loss = 0.7;
constexpr double reno_step = 3.0 * (1.0 - kept_after_loss) / (1.0 + kept_after_loss);
constexpr double least_segments = 2.0;
constexpr double most_growth = 1.5;                     // of the window in a round trip
constexpr double smoothing = 0.125;                     // of the round trip
constexpr std::int64_t min_timeout_us = 200'000;        // Linux's TCP_RTO_MIN
constexpr std::int64_t initial_timeout_us = 1'000'000;  // before a round trip is known

}  // namespace

std::int64_t TcpWindow::timeout_us() const {
  if (round_trip_s_ <= 0.0) return initial_timeout_us;
  return static_cast<std::int64_t>(1e6 * round_trip_s_) + min_timeout_us;
}

void TcpWindow::restart_after_idle(std::int64_t now_us) {
  if (in_flight_ > 0.0 || last_sent_us_ < 0 || now_us - last_sent_us_ <= timeout_us()) return;
  threshold_ = std::max(threshold_, 0.75 * window_);
  for (std::int64_t idle_us = now_us - last_sent_us_;
       idle_us > timeout_us() && window_ > initial_segments; idle_us -= timeout_us())
    window_ = std::max(initial_segments, 0.5 * window_);
  if (epoch_us_ >= 0) epoch_us_ += now_us - last_sent_us_;  // nothing grew meanwhile
  peak_ = last_peak_ = 0.0;
  full_ = last_full_ = false;
}

void TcpWindow::sent(std::int64_t now_us) {
  restart_after_idle(now_us);
  last_sent_us_ = now_us;
  peak_ = std::max(peak_, ++in_flight_);
  full_ = full_ || in_flight_ + 1.0 > window_;
}

bool TcpWindow::used() const {
  return slow_start() ? window_ < 2.0 * std::max(peak_, last_peak_) : full_ || last_full_;
}

void TcpWindow::acked(std::int64_t sent_us, std::int64_t now_us) {
  in_flight_ = std::max(0.0, in_flight_ - 1.0);
  const double round_trip_s =
      1e-6 * static_cast<double>(std::max<std::int64_t>(1, now_us - sent_us));
  round_trip_s_ += (round_trip_s_ > 0.0 ? smoothing : 1.0) * (round_trip_s - round_trip_s_);
  const bool may_grow = sent_us >= reduced_us_ && used();
  if (sent_us >= round_us_) {
    round_us_ = now_us;
    last_peak_ = peak_;
    peak_ = in_flight_;
    last_full_ = std::exchange(full_, false);
  }
  if (!may_grow) return;
  if (slow_start())
    window_ = std::min(window_ + 1.0, std::max(threshold_, window_));
  else
    grow_by_cubic(now_us);
}

void TcpWindow::grow_by_cubic(std::int64_t now_us) {
  if (epoch_us_ < 0) {
    epoch_us_ = now_us;
    reno_ = window_;
    origin_ = std::max(largest_, window_);
    plateau_s_ = std::cbrt((origin_ - window_) / cubic);
  }
  const double since_s = 1e-6 * static_cast<double>(now_us - epoch_us_) + round_trip_s_;
  const double target = std::clamp(origin_ + cubic * std::pow(since_s - plateau_s_, 3.0), window_,
                                   most_growth * window_);
  reno_ += (reno_ < largest_ ? reno_step : 1.0) / window_;
  window_ = std::max(window_ + (target - window_) / window_, reno_);
}

void TcpWindow::reduce() {
  // A window that did not reach its former size leaves room to others: fast convergence.
  largest_ = window_ < largest_ ? 0.5 * (1.0 + kept_after_loss) * window_ : window_;
  threshold_ = std::max(least_segments, kept_after_loss * window_);
  epoch_us_ = -1;
}

void TcpWindow::lost(std::int64_t sent_us, std::int64_t now_us) {
  if (sent_us < reduced_us_) return;
  reduce();
  window_ = threshold_;
  reduced_us_ = now_us;
}

void TcpWindow::timed_out(std::int64_t now_us) {
  reduce();
  window_ = 1.0;
  reduced_us_ = now_us;
}

}  // namespace catgs::load
