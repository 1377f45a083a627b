#include "server/flow/rate_controller.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace catgs {
namespace {

using std::chrono::microseconds;
using namespace std::chrono_literals;

constexpr double fast_growth_per_s = 1.5;  // from 5 to 40 Mbit/s in two to three seconds
constexpr double slow_growth_per_s = 0.15;
constexpr double regaining_growth_per_s = 4.0;  // tenfold in 0.6 s
constexpr double near_capacity = 0.85;
constexpr double beyond_capacity = 1.1;
constexpr double most_over_delivered = 2.5;
constexpr double back_off_share = 0.92;
constexpr double long_queue_share = 0.85;
constexpr microseconds long_queue = 50ms;
// A client's times are not trusted: its queue counts as no longer than this.
constexpr std::int64_t longest_queue_us = 10'000'000;
constexpr auto memory = 200ms;
constexpr std::size_t least_remembered =
    3;  // a slow link's frames may be further apart than the window
constexpr std::size_t most_remembered = 64;
constexpr auto longest_step = 100ms;
constexpr auto silence = 1s;
constexpr auto busy_holds = 10s;
constexpr double restart_share = 0.25;
constexpr int futile_back_offs = 5;
constexpr double hardly_shorter = 0.8;

}  // namespace

void RateController::set_limits(const Limits& limits) {
  limits_ = limits;
  clamp_rate();
}

void RateController::clamp_rate() { rate_ = std::clamp(rate_, limits_.least, limits_.most); }

void RateController::add(const Sample& sample, TimePoint now) {
  if (last_add_ && now - *last_add_ > silence) {
    recent_.clear();
    capacity_.reset();
    // After a long round trip the sender was not idle: the sample was in flight.
    const bool idle = sample.round_trip <= silence;
    if (!idle) rate_ = std::min(rate_, restart_share * limits_.start);
    clamp_rate();
    regains_ = idle && rate_ < carried_;
  }
  const std::int64_t queue_us = queue_of(sample, now);
  remember(sample, queue_us, now);
  if (sample.delays_us[0] && has_sped_up(*sample.delays_us[0], now)) capacity_.reset();
  if (queue_ <= target_) back_offs_in_a_row_ = 0;
  if (!hold_until_ || now >= *hold_until_) {
    if (queue_ > target_)
      back_off(sample, now);
    else if (queue_us <= target_.count())
      grow(now);
  }
  last_add_ = now;
}

void RateController::forget_path() {
  for (RunningMinimum& base : base_) base.reset();
  recent_.clear();
  capacity_.reset();
  least_delay_us_ = {};
  queue_ = {};
  last_add_.reset();
  hold_until_.reset();
  last_back_off_.reset();
  back_offs_in_a_row_ = 0;
  carried_ = 0.0;
  regains_ = false;
}

std::int64_t RateController::queue_of(const Sample& sample, TimePoint now) {
  std::optional<std::int64_t> queue_us;
  for (std::size_t i = 0; i < base_.size(); ++i) {
    if (!sample.delays_us[i]) continue;
    base_[i].add(*sample.delays_us[i], now);
    const std::int64_t excess_us = *sample.delays_us[i] - *base_[i].value();
    queue_us = std::min(excess_us, queue_us.value_or(excess_us));
  }
  const std::int64_t own_us = std::max<std::int64_t>(0, sample.own.count());
  return std::clamp<std::int64_t>(queue_us.value_or(0) - own_us, 0, longest_queue_us);
}

void RateController::remember(const Sample& sample, std::int64_t queue_us, TimePoint now) {
  recent_.push_back({now, sample.finished_us, sample.units, queue_us});
  while (recent_.size() > least_remembered &&
         (recent_.size() > most_remembered || now - recent_.front().acknowledged > memory))
    recent_.pop_front();
  queue_ = microseconds(std::ranges::min(recent_, {}, &Passed::queue_us).queue_us);
}

double RateController::steady_rate(TimePoint now) const {
  return within(last_back_off_, busy_holds, now)
             ? std::clamp(passed_when_busy_, limits_.least, rate_)
             : rate_;
}

std::optional<double> RateController::delivered() const {
  if (recent_.size() < 2) return std::nullopt;
  auto passed = recent_;
  std::ranges::sort(passed, {}, &Passed::finished_us);
  double units = 0.0;
  double longest_units = 0.0;
  std::int64_t longest_us = 0;
  for (std::size_t i = 1; i < passed.size(); ++i) {
    units += passed[i].units;  // the first one's units passed before the span begins
    const std::int64_t gap_us = passed[i].finished_us - passed[i - 1].finished_us;
    if (gap_us <= longest_us) continue;
    longest_us = gap_us;
    longest_units = passed[i].units;
  }
  std::int64_t span_us = passed.back().finished_us - passed.front().finished_us;
  if (passed.size() > 2 && 2 * longest_us > span_us) {  // a stall
    span_us -= longest_us;
    units -= longest_units;
  }
  if (span_us <= 0) return std::nullopt;
  return units * 1e6 / static_cast<double>(span_us);
}

void RateController::back_off(const Sample& sample, TimePoint now) {
  const auto passed = delivered();
  if (!passed) return;
  capacity_ = passed_when_busy_ = *passed;
  last_back_off_ = now;
  const double before = rate_;
  rate_ = std::min(rate_, *passed * (queue_ > long_queue ? long_queue_share : back_off_share));
  if (rate_ < before && std::exchange(regains_, false))
    carried_ = std::sqrt(carried_ * std::min(carried_, *passed));
  clamp_rate();
  hold_until_ = now + sample.round_trip + memory / 2;
  if (++back_offs_in_a_row_ == 1) queue_at_first_ = queue_;
  if (back_offs_in_a_row_ < futile_back_offs) return;
  back_offs_in_a_row_ = 0;
  const std::chrono::duration<double> hardly = hardly_shorter * queue_at_first_;
  if (queue_ < hardly) return;
  for (RunningMinimum& base : base_) base.reset();
}

bool RateController::has_sped_up(std::int64_t delay_us, TimePoint now) {
  if (!within(second_begun_, 1s, now)) {
    second_begun_ = now;
    least_delay_us_ = {std::nullopt, least_delay_us_[0]};
  }
  auto& [newest, before] = least_delay_us_;
  const bool faster =
      before && delay_us < std::min(newest.value_or(*before), *before) - target_.count() / 3;
  newest = std::min(delay_us, newest.value_or(delay_us));
  return faster;
}

void RateController::grow(TimePoint now) {
  const auto passed = delivered();
  if (!passed) return;
  carried_ = std::max(carried_, std::min(rate_, *passed));
  if (rate_ > most_over_delivered * *passed) return;
  if (capacity_ && rate_ > beyond_capacity * *capacity_) capacity_.reset();
  const bool careful = capacity_ && rate_ > near_capacity * *capacity_;
  const std::chrono::duration<double> step =
      last_add_ ? std::min<Clock::duration>(now - *last_add_, longest_step) : longest_step;
  const double room =
      1.0 - static_cast<double>(queue_.count()) / static_cast<double>(target_.count());
  regains_ = regains_ && rate_ < carried_;
  const double growth_per_s = regains_  ? regaining_growth_per_s
                              : careful ? slow_growth_per_s
                                        : fast_growth_per_s;
  rate_ *= std::exp(growth_per_s * room * step.count());
  clamp_rate();
}

}  // namespace catgs
