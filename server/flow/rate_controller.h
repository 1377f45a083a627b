#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>

#include "server/base/clock.h"
#include "server/base/running_minimum.h"

namespace catgs {

/// Estimates the rate that a stage beyond this server (network or decoder) can take, from the
/// delays of its samples. The caller chooses the unit: bits for a network, pixels for a decoder.
///
/// A sample's queue is its delay less the least delay of the last five to ten seconds, so clocks
/// need not agree. A sample timed by two clocks counts the lesser queue, so that a jump of the
/// client's clock is ignored. The standing queue is the least of the last 200 ms, which ignores
/// jitter. The target delay T is one frame interval. A link filled by frames delays each by T, so
/// it is known to be full before frames wait.
/// - Below T the rate grows by growth * (1 - queue / T) a second, unless the newest sample warns.
///   Growth is fast while the capacity is unknown, slow near it, and fast again once the rate has
///   passed it by a tenth. The rate stays within 2.5 times the delivered rate.
/// - Above T the stage is busy, so the delivered rate is its capacity. The rate becomes 0.92 of
///   that, or 0.85 if the queue is long. It then stays until the change shows in the samples.
/// - After a second without samples, the capacity may have changed unseen. If the path has carried
///   more than the present rate, the rate then grows very fast, up to what it has carried, until
///   something queues. An attempt that fails makes the next one shorter.
/// - When delays become shorter than in the last second, the capacity may have grown: it is unknown
///   again. So it is when a back-off has emptied a queue. To wait for a second after each back-off
///   left 81 % of the rate 2 s after a link was back, instead of 90 %.
/// - A stall, such as TCP's after a burst of losses, does not lower the capacity. A gap longer than
///   all others together is left out of the delivered rate.
/// - After five back-offs in a row without a shorter queue, the path has become longer or is filled
///   by others. Delays are from then on compared with the present ones.
/// Pure; not thread-safe.
class RateController {
 public:
  struct Limits {
    double least = 0.0;
    double most = 0.0;
    double start = 0.0;  // at most a quarter of it after a second without delivery
  };

  struct Sample {
    /// Delays from here to the far end. Each has an unknown but constant offset.
    std::array<std::optional<std::int64_t>, 2> delays_us{};
    std::int64_t finished_us = 0;  // arrival time on the receiver's clock
    double units = 0.0;
    std::chrono::microseconds round_trip{0};  // until a change of the rate shows
    std::chrono::microseconds own{
        0};  // part of the delay that is no queue: a frame large on purpose
  };

  explicit RateController(const Limits& limits) : limits_(limits), rate_(limits.start) {}

  /// Keeps the learnt state.
  void set_limits(const Limits& limits);
  void set_target_delay(std::chrono::microseconds target) { target_ = target; }
  void add(const Sample& sample, TimePoint now);
  /// Starts new delay statistics, because later delays do not compare with earlier ones. The rate
  /// stays.
  void forget_path();

  [[nodiscard]] double rate() const { return rate_; }  // units per second
  /// The safe rate: at most the rate delivered when the stage was last busy, unless that was long
  /// ago. rate() itself probes up to half as much again at times.
  [[nodiscard]] double steady_rate(TimePoint now) const;
  [[nodiscard]] std::chrono::microseconds target_delay() const { return target_; }
  /// The standing queue in front of the stage: the least of the last 200 ms.
  [[nodiscard]] std::chrono::microseconds queue_delay() const { return queue_; }
  /// The recently delivered rate in units per second; nothing if it is not known.
  [[nodiscard]] std::optional<double> delivered() const;

 private:
  struct Passed {
    TimePoint acknowledged;
    std::int64_t finished_us;
    double units;
    std::int64_t queue_us;
  };
  std::int64_t queue_of(const Sample& sample, TimePoint now);
  void remember(const Sample& sample, std::int64_t queue_us, TimePoint now);
  void back_off(const Sample& sample, TimePoint now);
  void grow(TimePoint now);
  /// Whether the delay on the way has fallen under its least of the last one to two seconds.
  bool has_sped_up(std::int64_t delay_us, TimePoint now);
  void clamp_rate();

  Limits limits_;
  double rate_;
  std::chrono::microseconds target_{15'000};
  std::array<RunningMinimum, 2> base_;
  std::deque<Passed> recent_;
  std::chrono::microseconds queue_{0};
  std::array<std::optional<std::int64_t>, 2> least_delay_us_{};  // of this second and the last one
  std::optional<TimePoint> second_begun_;
  std::optional<double> capacity_;  // delivered rate when the stage was last busy
  double passed_when_busy_ = 0.0;   // the same, kept however far the rate has grown since
  double carried_ = 0.0;  // the most that was delivered without a queue; less after attempts failed
  bool regains_ = false;  // grows towards that
  std::optional<TimePoint> last_back_off_;
  std::optional<TimePoint> last_add_;
  std::optional<TimePoint> hold_until_;  // samples in flight were sent at the previous rate
  int back_offs_in_a_row_ = 0;
  std::chrono::microseconds queue_at_first_{0};
};

}  // namespace catgs
