#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

#include "server/base/clock.h"

namespace catgs {

/// Decides when a frame is an IDR. The first IDR of a stream or connection comes at once. IDRs that
/// answer trouble keep a distance from the last one, because they are large and fill a congested
/// link further. Pure; not thread-safe.
class IdrPolicy {
 public:
  static constexpr std::chrono::milliseconds least_gap{250};
  /// For IDRs that answer repeated drops, the gap doubles up to this.
  static constexpr std::chrono::milliseconds most_gap{2000};

  /// The stream begins.
  void begin() {
    wanted_ = useless_without_ = true;
    earliest_.reset();
  }
  /// A decoder lost its reference. It still gets other frames, because spectators may be able to
  /// decode them.
  void request() { want_after(least_gap); }
  /// The client missed frames and cannot decode the following ones.
  void missed() {
    useless_without_ = true;
    want_after(least_gap);
  }
  /// Frames were dropped because the ring was full. The ring refuses all others until the next IDR.
  void dropped(TimePoint now) {
    if (!useless_without_)
      drop_gap_ = within(last_drop_, calm, now) ? std::min(2 * drop_gap_, most_gap) : least_gap;
    last_drop_ = now;
    useless_without_ = true;
    want_after(drop_gap_);
  }

  [[nodiscard]] bool wanted() const { return wanted_; }
  /// No frame is worth making before this time; none: any frame is.
  [[nodiscard]] std::optional<TimePoint> no_frame_before() const {
    return useless_without_ ? earliest_ : std::nullopt;
  }
  /// When an IDR may be made, if one is wanted; none: at once.
  [[nodiscard]] std::optional<TimePoint> earliest() const { return earliest_; }

  /// A frame starts. True: as an IDR.
  bool take(TimePoint now) {
    if (!wanted_ || earliest_ > now) return false;
    wanted_ = useless_without_ = false;
    last_ = now;
    return true;
  }

 private:
  static constexpr std::chrono::seconds calm{5};  // older drops are forgotten

  void want_after(std::chrono::milliseconds gap) {
    std::optional<TimePoint> at;
    if (last_) at = *last_ + gap;
    earliest_ = wanted_ ? std::max(earliest_, at) : at;
    wanted_ = true;
  }

  bool wanted_ = false;
  bool useless_without_ = false;
  std::optional<TimePoint> earliest_;
  std::optional<TimePoint> last_;
  std::optional<TimePoint> last_drop_;
  std::chrono::milliseconds drop_gap_ = least_gap;
};

}  // namespace catgs
