#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "server/base/clock.h"

namespace catgs {

/// Paces a visit's frames at its nominal rate and measures their real rate. Pure; not thread-safe.
class FramePace {
 public:
  /// The earliest start of the next frame, whatever it shows; none: at any time.
  [[nodiscard]] std::optional<TimePoint> next_start() const { return next_start_; }
  /// The start of a frame of the newest pose. Frames start on the arrival of the pose nearest to
  /// next_start(). A frame started by the clock alone would show a pose up to one pose interval
  /// old. Later poses do not delay the frame.
  [[nodiscard]] std::optional<TimePoint> next_start_of_pose() const {
    if (!next_start_) return due_since_;
    return due_since_.value_or(*next_start_ + half_pose_interval_);
  }
  /// `interval` is the nominal frame interval.
  void pose_arrived(std::chrono::microseconds interval, TimePoint now) {
    // A longer gap is a pause of the motion. Poses slower than frames each start one.
    const Duration half_frame = interval / 2;
    const Duration half_gap = newest_pose_ ? (now - *newest_pose_) / 2 : half_frame;
    newest_pose_ = now;
    half_pose_interval_ += (std::min(half_gap, half_frame) - half_pose_interval_) / 8;
    if (!due_since_ && (!next_start_ || now >= *next_start_ - half_pose_interval_))
      due_since_ = now;
  }
  /// The link, and not the renderer, keeps a frame from starting.
  void held_back(TimePoint now) { held_back_ = now; }

  /// A frame starts. The nominal `interval` is kept on average, but lost time is not caught up.
  void frame_starts(std::chrono::microseconds interval, TimePoint now) {
    measure(interval, now);
    const TimePoint least = now - interval;
    next_start_ = std::max(next_start_.value_or(least), least) + interval;
    due_since_.reset();
  }

  /// The camera rests. The pause until it moves again does not count as a frame interval.
  void rests() {
    last_start_.reset();
    due_since_.reset();
  }

  /// The mean interval of about eight frame starts; 0: not known.
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
    Seconds interval = last_start_ ? now - *last_start_ : longest_interval;
    last_start_ = now;
    // The frame waited for the link. Larger frames would make it wait longer.
    if (held_back_ > next_start_) interval = nominal;
    if (interval >= longest_interval) return;
    mean_interval_ += (interval - mean_interval_) / 8.0;
    measured_ = true;
  }

  std::optional<TimePoint> next_start_;
  std::optional<TimePoint> last_start_;  // none: no frame since the motion began
  std::optional<TimePoint> newest_pose_;
  std::optional<TimePoint> due_since_;
  Duration half_pose_interval_{};  // the mean over about eight of them
  std::optional<TimePoint> held_back_;
  Seconds mean_interval_{0.05};
  bool measured_ = false;
};

}  // namespace catgs
