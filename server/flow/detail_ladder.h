#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <optional>
#include <vector>

#include "server/base/clock.h"

namespace catgs {

/// Chooses the detail of a tree's pictures by what rendering sustains. It is the policy's, and
/// where frames take too long, 1 and then 2 px. Pictures lose detail before they lose pixels.
/// - Coarser: after one second in which a frame takes 70 % of its interval to render.
/// - Finer: after three seconds in which it takes 30 %. The next rung draws at most twice as much.
/// Pure; not thread-safe.
class DetailLadder {
 public:
  /// `detail_px`: the finest; 0: all Gaussians, whatever they cost.
  explicit DetailLadder(float detail_px) : rungs_{detail_px} {
    for (const float coarser : {1.0f, 2.0f})
      if (detail_px > 0.0f && coarser > detail_px) rungs_.push_back(coarser);
  }

  /// `render`: smoothed time of one frame. Call it after each frame of a moving camera.
  void update(Clock::duration render, Clock::duration interval, TimePoint now) {
    using namespace std::chrono_literals;
    constexpr double short_of_time = 0.7, has_time = 0.3;
    const double share = std::chrono::duration<double>(render) / interval;
    slow_since_ = held_since(slow_since_, share > short_of_time, now);
    quick_since_ = held_since(quick_since_, share < has_time, now);
    if (current_ + 1 < rungs_.size() && held_for(slow_since_, 1s, now)) {
      step_to(current_ + 1);
    } else if (current_ > 0 && held_for(quick_since_, 3s, now)) {
      step_to(current_ - 1);
    }
  }

  [[nodiscard]] float detail_px() const { return rungs_[current_]; }

 private:
  void step_to(std::size_t rung) {
    current_ = rung;
    slow_since_.reset();
    quick_since_.reset();
  }

  std::vector<float> rungs_;
  std::size_t current_ = 0;
  std::optional<TimePoint> slow_since_;
  std::optional<TimePoint> quick_since_;
};

}  // namespace catgs
