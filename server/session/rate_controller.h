#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>

#include "server/session/running_minimum.h"

namespace catgs {

/// How much a stage beyond this server (the network, a decoder) may be given per second, judged by
/// how long things take to pass it. Units are the caller's: bits for a network, pixels for a
/// decoder.
///
/// The queue of a sample is its delay less the least one of the last five to ten seconds, so clocks
/// need not agree; where a sample is timed by two clocks, the lesser of both counts, so that a jump
/// of the client's clock is no queue. The queue that stands is the least of the last 200 ms: jitter
/// is none. T is the delay that is aimed at, a frame interval: on a link that it fills, a frame
/// takes that long to pass, so that the link is known to be full before frames wait.
/// - Below T the rate grows, unless the newest sample warns, by growth * (1 - queue / T) a second:
///   fast until something is known of the capacity, slowly near it, fast again once the rate has
///   passed it by a tenth. Growth beyond 2.5 times what really passes would be a guess and is not
///   made.
/// - Above T the stage is busy, so that what passes is its capacity: the rate becomes 0.92 of that,
///   0.85 where the queue is long, and stays until the change shows in the samples.
/// - A stall, as TCP makes of a burst of losses, is no want of capacity: a gap longer than all
///   others together does not count in what passes.
/// - Backing off five times in a row without a shorter queue means that the path has become longer,
///   or that others fill it: from there on delays are compared with what they are now.
/// Pure; not thread-safe.
class RateController {
 public:
  struct Limits {
    double least = 0.0;
    double most = 0.0;
    double start = 0.0;  // a quarter of it at most after a second in which nothing passed
  };

  struct Sample {
    /// From here to the far end, each with an unknown but constant offset.
    std::array<std::optional<std::int64_t>, 2> delays_us{};
    std::int64_t finished_us = 0;  // when it arrived there, on the receiver's clock
    double units = 0.0;
    std::chrono::microseconds round_trip{0};  // until a change of the rate shows
    std::chrono::microseconds own{0};  // of the delay, what is no queue: it was large on purpose
  };

  explicit RateController(const Limits& limits) : limits_(limits), rate_(limits.start) {}

  /// Keeps what was learnt.
  void set_limits(const Limits& limits);
  void set_target_delay(std::chrono::microseconds target) { target_ = target; }
  void add(const Sample& sample, TimePoint now);
  /// Delays from here on have nothing to do with those before; the rate stays.
  void forget_path();

  [[nodiscard]] double rate() const { return rate_; }  // units per second
  /// What surely passes: no more than passed when the stage was last known to be busy, unless that
  /// is long ago. The rate itself finds out what passes by going half again as far at times.
  [[nodiscard]] double steady_rate(TimePoint now) const;
  [[nodiscard]] std::chrono::microseconds target_delay() const { return target_; }
  /// What stands in front of the stage, least of the last 200 ms.
  [[nodiscard]] std::chrono::microseconds queue_delay() const { return queue_; }
  /// What has passed lately, units per second; nothing when that is not known.
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
  void clamp_rate();

  Limits limits_;
  double rate_;
  std::chrono::microseconds target_{15'000};
  std::array<RunningMinimum, 2> base_;
  std::deque<Passed> recent_;
  std::chrono::microseconds queue_{0};
  std::optional<double> capacity_;  // what passed when the stage was last known to be busy
  double passed_when_busy_ = 0.0;   // the same, kept however far the rate has grown since
  TimePoint last_back_off_{};
  TimePoint last_add_{};
  TimePoint hold_until_{};  // what is on its way was sent at the rate before
  int back_offs_in_a_row_ = 0;
  std::chrono::microseconds queue_at_first_{0};
};

}  // namespace catgs
