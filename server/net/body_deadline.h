#pragma once

#include <chrono>
#include <cstddef>

#include "server/base/clock.h"

namespace catgs {

/// By when the body of an upload must have arrived. It has a time for the whole body. It also needs
/// a least rate all the while: bytes that came early do not pay for a pause later.
class BodyDeadline {
 public:
  /// `bytes`: the announced length.
  BodyDeadline(std::size_t bytes, TimePoint now);

  void arrived(std::size_t bytes, TimePoint now);
  [[nodiscard]] TimePoint at() const;

  static constexpr std::chrono::seconds whole_time{30};  // and more for long bodies
  static constexpr double whole_bytes_per_s = 128 * 1024;
  static constexpr std::chrono::seconds grace{10};  // without any progress
  static constexpr double least_bytes_per_s = 64 * 1024;

 private:
  TimePoint whole_;
  TimePoint progress_;
};

}  // namespace catgs
