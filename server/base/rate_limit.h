#pragma once

#include <algorithm>

#include "server/base/clock.h"

namespace catgs {

/// Token bucket: `burst` at once, `per_second` in the long run. Not thread-safe.
class RateLimit {
 public:
  RateLimit(double per_second, double burst, TimePoint now)
      : per_second_(per_second), burst_(burst), tokens_(burst), last_(now) {}

  /// False: too many, and nothing is taken.
  bool take(TimePoint now, double tokens = 1.0) {
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    tokens_ = std::min(burst_, tokens_ + seconds * per_second_);
    if (tokens_ < tokens) return false;
    tokens_ -= tokens;
    return true;
  }

 private:
  double per_second_;
  double burst_;
  double tokens_;
  TimePoint last_;
};

}  // namespace catgs
