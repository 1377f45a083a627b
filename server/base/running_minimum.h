#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>

#include "server/base/clock.h"

namespace catgs {

/// The least value of the last one to two spans. It estimates a delay without queues on a path that
/// may change. After a silence of a whole span, older values are dropped.
class RunningMinimum {
 public:
  explicit RunningMinimum(std::chrono::seconds span = std::chrono::seconds(5)) : span_(span) {}

  void add(std::int64_t value, TimePoint now) {
    if (!start_ || now - *start_ >= span_) {
      previous_ = start_ && now - *start_ < 2 * span_ ? current_ : std::nullopt;
      current_.reset();
      start_ = now;
    }
    current_ = std::min(value, current_.value_or(value));
  }

  void reset() {
    current_.reset();
    previous_.reset();
  }

  [[nodiscard]] std::optional<std::int64_t> value() const {
    if (!current_ || !previous_) return current_ ? current_ : previous_;
    return std::min(*current_, *previous_);
  }

 private:
  std::chrono::seconds span_;
  std::optional<TimePoint> start_;
  std::optional<std::int64_t> current_;
  std::optional<std::int64_t> previous_;
};

}  // namespace catgs
