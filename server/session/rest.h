#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <optional>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// When a camera rests: as its client says that nothing moves it, or when it has not moved for
/// `least`, nor for twice as long as its poses take to follow each other, the quickest of the last
/// few. What a client that sends few of them shows between two is no rest. A client is believed
/// once in `least`: one that says it with every pose gets no more stills than one that stops so
/// often. Pure; not thread-safe.
class Rest {
 public:
  explicit Rest(std::chrono::milliseconds least) : least_(least) {}

  void moved(TimePoint now) {
    constexpr Clock::duration longest_gap = std::chrono::milliseconds(500);
    gaps_[next_] = std::min(now - last_motion_, longest_gap);
    next_ = (next_ + 1) % gaps_.size();
    last_motion_ = now;
    said_.reset();
  }
  /// The client says so.
  void said(TimePoint now) {
    if (said_ || now - believed_ < least_) return;
    said_ = believed_ = now;
  }
  [[nodiscard]] TimePoint begins() const {
    const Clock::duration quickest = *std::ranges::min_element(gaps_);
    const TimePoint seen = last_motion_ + std::max<Clock::duration>(least_, 2 * quickest);
    return std::min(seen, said_.value_or(seen));
  }

 private:
  std::chrono::milliseconds least_;
  TimePoint last_motion_{};
  std::optional<TimePoint> said_;  // since the last motion
  TimePoint believed_{};
  std::array<Clock::duration, 4> gaps_{};
  std::size_t next_ = 0;
};

}  // namespace catgs
