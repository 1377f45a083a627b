#pragma once

#include <algorithm>
#include <chrono>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// When a frame is an IDR. One that begins a stream, or a stream on another connection, is made at
/// once. Those that answer trouble keep a distance from the last one: an IDR is many times the size
/// of other frames, and more of them make a full way fuller. Pure; not thread-safe.
class IdrPolicy {
 public:
  static constexpr std::chrono::milliseconds least_gap{250};
  /// Between IDRs that are answers to drops, one right after the other: the gap doubles up to this.
  static constexpr std::chrono::milliseconds most_gap{2000};

  /// The stream begins.
  void begin() {
    wanted_ = useless_without_ = true;
    earliest_ = {};
  }
  /// A decoder has lost the thread. It gets other frames meanwhile: others may look on.
  void request() { want_after(least_gap); }
  /// The client has missed frames: it can make nothing of those that follow.
  void missed() {
    useless_without_ = true;
    want_after(least_gap);
  }
  /// Frames found no room on their way, and nothing but an IDR would find any.
  void dropped(TimePoint now) {
    if (!useless_without_)
      drop_gap_ = now - last_drop_ < calm ? std::min(2 * drop_gap_, most_gap) : least_gap;
    last_drop_ = now;
    useless_without_ = true;
    want_after(drop_gap_);
  }

  [[nodiscard]] bool wanted() const { return wanted_; }
  /// No frame is worth making before this; the epoch: any is.
  [[nodiscard]] TimePoint no_frame_before() const {
    return useless_without_ ? earliest_ : TimePoint{};
  }
  /// When an IDR may be made, if one is wanted.
  [[nodiscard]] TimePoint earliest() const { return earliest_; }

  /// A frame starts. True: as an IDR.
  bool take(TimePoint now) {
    if (!wanted_ || now < earliest_) return false;
    wanted_ = useless_without_ = false;
    last_ = now;
    return true;
  }

 private:
  static constexpr std::chrono::seconds calm{5};  // what was dropped before it is forgotten

  void want_after(std::chrono::milliseconds gap) {
    earliest_ = wanted_ ? std::max(earliest_, last_ + gap) : last_ + gap;
    wanted_ = true;
  }

  bool wanted_ = false;
  bool useless_without_ = false;
  TimePoint earliest_{};
  TimePoint last_{};
  TimePoint last_drop_{};
  std::chrono::milliseconds drop_gap_ = least_gap;
};

}  // namespace catgs
