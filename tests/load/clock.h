#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>

namespace catgs::load {

using Clock = std::chrono::steady_clock;

/// Microseconds on the clock of all sessions.
inline std::int64_t now_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch())
      .count();
}

inline Clock::time_point clock_time(std::int64_t time_us) {
  return Clock::time_point(std::chrono::microseconds(time_us));
}

inline std::int64_t microseconds(double seconds) { return std::llround(1e6 * seconds); }

}  // namespace catgs::load
