#include "render_core/motion/predictor.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace catgs {
namespace {

constexpr std::int64_t memory_us = 1'000'000;
// Closer stamps are jitter: dividing a step by them would make a jump of it.
constexpr std::int64_t min_step_us = 4'000;

bool usable(const Pose& pose) {
  const glm::vec3& p = pose.position;
  const float norm = glm::length(pose.orientation);
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z) && std::isfinite(norm) &&
         norm > 1e-6f;
}

/// Axis times angle of the rotation from `from` to `to`, in the axes of `from`.
glm::dvec3 rotation_between(const glm::quat& from, const glm::quat& to) {
  glm::dquat turn = glm::conjugate(glm::dquat(from)) * glm::dquat(to);
  if (turn.w < 0.0) turn = -turn;  // the short way
  const glm::dvec3 axis(turn.x, turn.y, turn.z);
  const double sine = glm::length(axis);
  return sine > 0.0 ? axis * (2.0 * std::atan2(sine, turn.w) / sine) : glm::dvec3(0.0);
}

glm::dquat rotation_by(const glm::dvec3& axis_angle) {
  const double angle = glm::length(axis_angle);
  return angle > 0.0 ? glm::angleAxis(angle, axis_angle / angle) : glm::dquat(1, 0, 0, 0);
}

struct Speed {
  double linear = 0.0, angular = 0.0;  // units / s, rad / s
};

Speed speed_between(const TimedPose& a, const TimedPose& b) {
  const double seconds = 1e-6 * static_cast<double>(std::max(b.time_us - a.time_us, min_step_us));
  const Pose& from = a.world_from_camera;
  const Pose& to = b.world_from_camera;
  return {glm::distance(glm::dvec3(from.position), glm::dvec3(to.position)) / seconds,
          glm::length(rotation_between(from.orientation, to.orientation)) / seconds};
}

}  // namespace

void MotionPredictor::add(const TimedPose& sample) {
  if (!usable(sample.world_from_camera)) return;
  TimedPose unit = sample;
  unit.world_from_camera.orientation = glm::normalize(sample.world_from_camera.orientation);
  if (samples_.empty()) return start_at(unit);
  const std::int64_t newest_us = samples_.back().time_us;
  if (std::abs(unit.time_us - newest_us) > settings_.gap_us) return start_at(unit);

  const auto place = std::ranges::lower_bound(samples_, unit.time_us, {}, &TimedPose::time_us);
  if (place != samples_.end() && place->time_us == unit.time_us) {
    *place = unit;
  } else if (place != samples_.end()) {
    if (place != samples_.begin()) samples_.insert(place, unit);
  } else if (is_jump(unit)) {
    start_at(unit);
  } else {
    samples_.push_back(unit);
  }
  const auto expired = std::ranges::lower_bound(samples_, samples_.back().time_us - memory_us, {},
                                                &TimedPose::time_us);
  const auto surplus = samples_.end() - std::min<std::ptrdiff_t>(samples_.size(), max_samples);
  samples_.erase(samples_.begin(), std::max(expired, surplus));
}

std::optional<Pose> MotionPredictor::at(std::int64_t time_us) const {
  if (samples_.empty()) return std::nullopt;
  const TimedPose& newest = samples_.back();
  const double seconds = 1e-6 * static_cast<double>(std::clamp<std::int64_t>(
                                    time_us - newest.time_us, 0, settings_.horizon_us));
  const Motion motion = fit();
  const Pose& from = newest.world_from_camera;
  return Pose{glm::vec3(glm::dvec3(from.position) + motion.velocity * seconds),
              glm::quat(glm::normalize(glm::dquat(from.orientation) *
                                       rotation_by(motion.angular_rate * seconds)))};
}

std::optional<Forecast> MotionPredictor::forecast(std::int64_t now_us, double rate_hz,
                                                  int frames) const {
  if (samples_.size() < 2 || now_us - samples_.back().time_us > settings_.gap_us) {
    return std::nullopt;
  }
  const std::int64_t ahead_us = std::llround(1e6 * static_cast<double>(frames) / rate_hz);
  return Forecast{*at(now_us + ahead_us), frames};
}

bool MotionPredictor::is_jump(const TimedPose& sample) const {
  if (samples_.size() < 2) return false;  // no speed to compare with
  Speed fastest;
  for (std::size_t i = 1; i < samples_.size(); ++i) {
    const Speed speed = speed_between(samples_[i - 1], samples_[i]);
    fastest.linear = std::max(fastest.linear, speed.linear);
    fastest.angular = std::max(fastest.angular, speed.angular);
  }
  const Speed speed = speed_between(samples_.back(), sample);
  return speed.linear > jump_ratio * fastest.linear || speed.angular > jump_ratio * fastest.angular;
}

/// Slopes of the lines through positions and rotation vectors over time. The newest sample itself
/// is where the motion goes on from: it is what the camera shows now.
MotionPredictor::Motion MotionPredictor::fit() const {
  const TimedPose& newest = samples_.back();
  auto first = std::ranges::lower_bound(samples_, newest.time_us - settings_.fit_us, {},
                                        &TimedPose::time_us);
  // Slow streams: two samples make a velocity, however far they are apart.
  first = std::min(first, samples_.end() - std::min<std::ptrdiff_t>(samples_.size(), 2));
  const auto count = static_cast<double>(samples_.end() - first);
  double time_sum = 0.0, time_square_sum = 0.0;
  Motion sum, product_sum;
  for (auto sample = first; sample != samples_.end(); ++sample) {
    const double time = 1e-6 * static_cast<double>(sample->time_us - newest.time_us);
    const glm::dvec3 shift = glm::dvec3(sample->world_from_camera.position) -
                             glm::dvec3(newest.world_from_camera.position);
    const glm::dvec3 turn = rotation_between(newest.world_from_camera.orientation,
                                             sample->world_from_camera.orientation);
    time_sum += time;
    time_square_sum += time * time;
    sum.velocity += shift;
    sum.angular_rate += turn;
    product_sum.velocity += time * shift;
    product_sum.angular_rate += time * turn;
  }
  const double spread = count * time_square_sum - time_sum * time_sum;
  if (!(spread > 0.0)) return {};  // a single sample
  return {(count * product_sum.velocity - time_sum * sum.velocity) / spread,
          (count * product_sum.angular_rate - time_sum * sum.angular_rate) / spread};
}

void MotionPredictor::start_at(const TimedPose& sample) { samples_.assign(1, sample); }

}  // namespace catgs
