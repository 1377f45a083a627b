#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/motion/frame_groups.h"
#include "render_core/motion/trajectory.h"

namespace catgs {

struct PredictorSettings {
  std::int64_t smoothing_us = 6'000;  // time constant of the velocities
  std::int64_t horizon_us = 100'000;  // no forecast reaches further
  std::int64_t gap_us = 250'000;      // a longer silence ends a motion
  // Forecasts are trusted at least this much (0…1), however wrong earlier ones were. With 1 the
  // camera continues at constant velocity over the whole horizon.
  double min_confidence = 0.0;
  // World units; the distance at which a shift counts as much as a turn. Forecasts of recorded head
  // motion hardly depend on it, from 0.5 to 10 m. The limit between tremor and motion does.
  double lever = 3.0;
};

/// The lever for a scene by its near plane, in its units: 3 for the usual 0.2, less where people
/// come nearer to smaller things.
constexpr double forecast_lever(float near_z) {
  return near_z > 0.0f ? 15.0 * static_cast<double>(near_z) : PredictorSettings{}.lever;
}

/// Forecasts a camera from its past: its smoothed velocity and angular rate, damped by the errors
/// of its own forecasts. One per camera; not thread-safe.
///
/// Confidence is the share of recent motion that forecasts made 33 ms ahead got right. It is 1 -
/// the sum of their errors over the sum of the motions, each sample weighed by exp(-age / 0.3 s). A
/// turn counts by its angle, a shift by the angle under which it appears a lever away. Doubt is 1 -
/// confidence, and velocity decays as exp(-t doubt / 120 ms). Under a confidence of one half the
/// horizon shrinks too, to half its length at one quarter. MEASURED.md compares this with other
/// methods.
///
/// Stamps lie within +-2^62 us. Samples may come irregularly and late:
/// - A sample with a known stamp replaces the earlier one.
/// - A sample out of order is inserted where it belongs. It is ignored if it is older than all that
///   are kept or tells nothing new.
/// - A sample later than the newest by more than gap_us, or earlier by as much (the clock was set),
///   begins a new motion.
/// - A teleport begins a new motion too: a step jump_ratio times faster than any of the last
///   second, in position or in orientation. The samples before it say nothing about the motion
///   after it. The same holds for a sudden start from rest. Nothing is forecast until two steps
///   agree.
/// - A sample that is not finite, or whose orientation is not a rotation, is ignored.
class MotionPredictor {
 public:
  explicit MotionPredictor(const PredictorSettings& settings = {}) : settings_(settings) {}

  void add(const TimedPose& sample);

  /// The expected pose at a time after the newest sample; empty before the first sample. A camera
  /// that is still, or whose motion is unknown, stays where it is.
  [[nodiscard]] std::optional<Pose> at(std::int64_t time_us) const;

  /// The expected camera for frames from `now_us` on: `frames` frames later, or fewer if the
  /// horizon ends before. Empty while the motion is unknown. A still camera stays over the whole
  /// horizon.
  [[nodiscard]] std::optional<Forecast> forecast(std::int64_t now_us, double rate_hz,
                                                 int frames) const;

  /// 0…1; a first guess until forecasts have been checked.
  [[nodiscard]] double confidence() const;

  /// Whether the camera has not moved for 100 ms, apart from the tremor of tracking.
  [[nodiscard]] bool still() const;

  static constexpr double jump_ratio = 10.0;

 private:
  struct Motion {
    bool known = false;
    glm::dvec3 velocity{0.0};      // world axes, units / s
    glm::dvec3 angular_rate{0.0};  // camera axes, rad / s
  };
  struct Sample {
    std::int64_t time_us = 0;
    Pose pose;
    Motion motion;
    double speed = 0.0, angular_speed = 0.0;  // of the step to here; units / s, rad / s
  };
  using Samples = std::vector<Sample>;

  void append(const Sample& sample);
  void insert(Samples::iterator position, const Sample& sample);
  void start_at(const Sample& sample);
  void follow(std::size_t index);
  void drop_a_jump_at_the_start();
  void check_forecast();
  [[nodiscard]] bool newest_is_a_jump() const;
  [[nodiscard]] double extent(const glm::dvec3& shift, const glm::dvec3& turn) const;
  [[nodiscard]] double extent_between(const Sample& from, const Sample& to) const;

  PredictorSettings settings_;
  Samples samples_;  // of one motion; increasing times, min_step_us apart but for the newest
  double error_ = 0.0, moved_ = 0.0;  // of forecasts, decaying sums; rad
};

}  // namespace catgs
