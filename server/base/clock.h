#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace catgs {

using Clock = std::chrono::steady_clock;
using TimePoint = Clock::time_point;

/// The wall clock's time in Unix seconds, as used in tokens.
inline std::int64_t unix_now_s() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::seconds>(now).count();
}

/// True if `then` was less than `span` ago.
inline bool within(const std::optional<TimePoint>& then, Clock::duration span, TimePoint now) {
  return then && now - *then < span;
}

/// Returns since when a condition holds. `before` is the last result.
inline std::optional<TimePoint> held_since(const std::optional<TimePoint>& before, bool holds,
                                           TimePoint now) {
  return holds ? before.value_or(now) : std::optional<TimePoint>();
}
/// True if the condition has held for at least `span`.
inline bool held_for(const std::optional<TimePoint>& since, Clock::duration span, TimePoint now) {
  return since && now - *since >= span;
}

}  // namespace catgs
