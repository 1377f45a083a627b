#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "render_core/motion/frame_groups.h"
#include "render_core/motion/trajectory.h"

namespace catgs {

struct PredictorSettings {
  // Velocities are fitted to the samples of this last while. Of 20…100 ms, 40 foresees recorded
  // head motion best at 8…66 ms: less follows the jitter of tracking, more lags behind turns.
  std::int64_t fit_us = 40'000;
  std::int64_t horizon_us = 100'000;  // the motion is not continued further than this
  std::int64_t gap_us = 250'000;      // a longer silence ends a motion
};

/// Where a camera is going, judged by where it has been: constant velocity and constant angular
/// rate, by least squares over its last samples. One per camera; not for several threads at once.
///
/// Stamps lie within +-2^62 us. Samples may come irregularly and late:
///  - one with a known stamp replaces that sample;
///  - one out of order is put where it belongs, or ignored if older than all that is kept;
///  - one later than the newest by more than gap_us, or earlier by as much (the clock was set),
///    begins a new motion;
///  - so does a jump: a step that is jump_ratio times faster than any of the last second, in
///    position or in orientation. Nothing before a teleport says where the camera goes after it,
///    and the same holds for a start from rest. No unit of length is needed for this;
///  - one that is not finite, or whose orientation is not a rotation, is ignored.
class MotionPredictor {
 public:
  explicit MotionPredictor(const PredictorSettings& settings = {}) : settings_(settings) {}

  void add(const TimedPose& sample);

  /// The expected pose at a time after the newest sample; nothing before the first sample. It stays
  /// where it is after a single sample, and stops horizon_us after the newest one.
  [[nodiscard]] std::optional<Pose> at(std::int64_t time_us) const;

  /// For a frame shown at `now_us`, the camera `frames` frames later; nothing while the motion is
  /// unknown (less than two samples of it, or none in the last gap_us).
  [[nodiscard]] std::optional<Forecast> forecast(std::int64_t now_us, double rate_hz,
                                                 int frames) const;

  static constexpr double jump_ratio = 10.0;
  static constexpr std::size_t max_samples = 256;  // a second at 120 Hz, with room for bursts

 private:
  /// Velocities in the frame of the newest sample.
  struct Motion {
    glm::dvec3 velocity{0.0};      // world axes, units / s
    glm::dvec3 angular_rate{0.0};  // camera axes of the newest sample, rad / s
  };
  [[nodiscard]] bool is_jump(const TimedPose& sample) const;
  [[nodiscard]] Motion fit() const;
  void start_at(const TimedPose& sample);

  PredictorSettings settings_;
  std::vector<TimedPose> samples_;  // increasing times, of one motion
};

}  // namespace catgs
