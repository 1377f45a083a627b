#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// When a session's frames may start at its nominal rate, and how fast they really follow each
/// other. Pure; not thread-safe.
class FramePace {
 public:
  /// The next frame starts no earlier, whatever it shows.
  [[nodiscard]] TimePoint next_start() const { return next_start_; }
  /// When a frame of the newest pose may start: as the pose arrives that comes nearest to
  /// next_start(). A frame that started by the clock alone would show a pose that has waited for up
  /// to the time between two. Poses that come later do not put it off.
  [[nodiscard]] TimePoint next_start_of_pose() const {
    return due_since_.value_or(next_start_ + half_pose_interval_);
  }
  /// `interval` is that of the nominal rate.
  void pose_arrived(std::chrono::microseconds interval, TimePoint now) {
    const Duration since = now - std::exchange(newest_pose_, now);
    // A longer gap is a pause of the motion; of slower poses each one starts a frame.
    const Duration half_frame = interval / 2;
    half_pose_interval_ += (std::min(since / 2, half_frame) - half_pose_interval_) / 8;
    if (!due_since_ && now >= next_start_ - half_pose_interval_) due_since_ = now;
  }
  /// An acknowledgement gave credit that was missing.
  void credit_returned(TimePoint now) { credit_since_ = now; }

  /// A frame starts; `interval` is that of the nominal rate, which is kept on average: what is lost
  /// is not caught up.
  void frame_starts(std::chrono::microseconds interval, TimePoint now) {
    measure(interval, now);
    next_start_ = std::max(next_start_, now - interval) + interval;
    due_since_.reset();
  }

  /// The camera rests: the time until it moves again is no interval between frames.
  void rests() {
    last_start_ = {};
    due_since_.reset();
  }

  /// Between starts of frames, the mean over about eight of them; 0: not known.
  [[nodiscard]] std::chrono::microseconds real_interval() const {
    return std::chrono::duration_cast<std::chrono::microseconds>(measured_ ? mean_interval_
                                                                           : Seconds(0.0));
  }
  [[nodiscard]] int real_fps(int nominal_fps) const {
    const double fps = 1.0 / std::max(mean_interval_.count(), 1e-3);
    return std::clamp(static_cast<int>(std::lround(fps)), 1, nominal_fps);
  }

 private:
  using Duration = TimePoint::duration;
  using Seconds = std::chrono::duration<double>;

  void measure(std::chrono::microseconds nominal, TimePoint now) {
    // A longer gap is a pause of the motion, not a slow renderer.
    constexpr std::chrono::milliseconds longest_interval{500};
    Seconds interval = now - last_start_;
    last_start_ = now;
    // It waited for credit: larger frames would make it wait longer.
    if (credit_since_ > next_start_) interval = nominal;
    if (interval >= longest_interval) return;
    mean_interval_ += (interval - mean_interval_) / 8.0;
    measured_ = true;
  }

  TimePoint next_start_{};
  TimePoint last_start_{};
  TimePoint newest_pose_{};
  std::optional<TimePoint> due_since_;
  Duration half_pose_interval_{};  // the mean over about eight of them
  TimePoint credit_since_{};
  Seconds mean_interval_{0.05};
  bool measured_ = false;
};

}  // namespace catgs
