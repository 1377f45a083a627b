#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <chrono>
#include <cstddef>
#include <optional>

#include "server/base/clock.h"

namespace catgs {

/// Detects when a camera rests. It rests when its client says so, or when it has not moved for
/// `least` and for twice its quickest recent pose interval. The gaps of a client that sends few
/// poses are therefore no rest. A client's word counts once in `least`, so that repeating it with
/// every pose earns no extra stills. Pure; not thread-safe.
class Rest {
 public:
  explicit Rest(std::chrono::milliseconds least) : least_(least) {}

  void moved(TimePoint now) {
    constexpr Clock::duration longest_gap = std::chrono::milliseconds(500);
    gaps_[next_] = last_motion_ ? std::min(now - *last_motion_, longest_gap) : longest_gap;
    next_ = (next_ + 1) % gaps_.size();
    last_motion_ = now;
    said_.reset();
  }
  /// The client says that nothing moves the camera.
  void said(TimePoint now) {
    if (said_ || within(believed_, least_, now)) return;
    said_ = believed_ = now;
  }
  /// Call it only after a pose. A first pose is a motion.
  [[nodiscard]] TimePoint begins() const {
    assert(last_motion_);
    const Clock::duration quickest = *std::ranges::min_element(gaps_);
    const TimePoint seen = *last_motion_ + std::max<Clock::duration>(least_, 2 * quickest);
    return std::min(seen, said_.value_or(seen));
  }

 private:
  std::chrono::milliseconds least_;
  std::optional<TimePoint> last_motion_;
  std::optional<TimePoint> said_;  // since the last motion
  std::optional<TimePoint> believed_;
  std::array<Clock::duration, 4> gaps_{};
  std::size_t next_ = 0;
};

}  // namespace catgs
