#include "render_core/motion/predictor.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <glm/geometric.hpp>

#include "render_core/motion/rotation.h"

namespace catgs {
namespace {

constexpr std::int64_t memory_us = 1'000'000;
// Stamps closer than this are jitter; dividing a step by them would make a jump of it.
constexpr std::int64_t min_step_us = 4'000;
// A sample may be this late and still leaves room for a forecast of the whole horizon.
constexpr std::int64_t max_age_us = 50'000;

// Confidence. On recorded head motion, with samples up to 20 ms late, these values make the
// smallest errors at 8…100 ms. Twice or half of any costs less than 2 % of them.
constexpr std::int64_t check_us = 33'000;
constexpr double fading_s = 0.3;
constexpr double damping_s = 0.12;
constexpr double first_doubt = 0.4;         // the usual one in these recordings
constexpr double first_doubt_moved = 1e-4;  // rad; it weighs as much as this much motion

// If the horizon shrank to nothing, recorded heads would have 2 to 5 % fewer frames per key frame.
// The trails in its lists would hardly be shorter, because far motion ends a window anyway.
constexpr double least_trust = 0.5;

constexpr std::int64_t still_us = 100'000;
constexpr double still_rad = 0.5e-3;  // half a pixel at a focal length of 1000 px
constexpr double jump_rad = 5e-3;     // smaller steps, of a few pixels, begin no new motion

bool usable(const Pose& pose) {
  const glm::vec3& p = pose.position;
  const float norm = glm::length(pose.orientation);
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z) && std::isfinite(norm) &&
         norm > 1e-6f;
}

/// In world axes, world units.
glm::dvec3 shift_between(const Pose& from, const Pose& to) {
  return glm::dvec3(to.position) - glm::dvec3(from.position);
}

/// As a rotation vector in the axes of `from`, rad.
glm::dvec3 turn_between(const Pose& from, const Pose& to) {
  return rotation_between(from.orientation, to.orientation);
}

double seconds_between(std::int64_t from_us, std::int64_t to_us) {
  return 1e-6 * static_cast<double>(to_us - from_us);
}

/// The way covered in `seconds` at a velocity that starts at 1 and decays at `rate_hz`.
double decaying_reach_s(double seconds, double rate_hz) {
  return rate_hz > 0.0 ? -std::expm1(-rate_hz * seconds) / rate_hz : seconds;
}

}  // namespace

void MotionPredictor::add(const TimedPose& timed) {
  if (!usable(timed.world_from_camera)) return;
  Sample sample{.time_us = timed.time_us, .pose = timed.world_from_camera, .motion = {}};
  sample.pose.orientation = glm::normalize(sample.pose.orientation);
  if (samples_.empty() || std::abs(sample.time_us - samples_.back().time_us) > settings_.gap_us) {
    return start_at(sample);
  }
  const auto point = std::ranges::lower_bound(samples_, sample.time_us, {}, &Sample::time_us);
  if (point == samples_.end()) {
    append(sample);
  } else {
    insert(point, sample);
  }
  const auto kept =
      std::ranges::lower_bound(samples_, samples_.back().time_us - memory_us, {}, &Sample::time_us);
  samples_.erase(samples_.begin(), kept);
}

void MotionPredictor::append(const Sample& sample) {
  const std::size_t count = samples_.size();
  if (count >= 2 && samples_[count - 1].time_us - samples_[count - 2].time_us < min_step_us) {
    samples_.pop_back();
  }
  samples_.push_back(sample);
  follow(samples_.size() - 1);
  drop_a_jump_at_the_start();
  if (newest_is_a_jump()) return start_at(sample);
  check_forecast();
}

void MotionPredictor::insert(Samples::iterator point, const Sample& sample) {
  if (point->time_us == sample.time_us) {
    point->pose = sample.pose;
  } else if (point == samples_.begin() ||
             sample.time_us - std::prev(point)->time_us < min_step_us ||
             point->time_us - sample.time_us < min_step_us) {
    return;
  } else {
    point = samples_.insert(point, sample);
  }
  for (auto i = static_cast<std::size_t>(point - samples_.begin()); i < samples_.size(); ++i) {
    follow(i);
  }
}

void MotionPredictor::start_at(const Sample& sample) {
  samples_.assign(1, sample);
  samples_.front().motion = {};
  error_ = moved_ = 0.0;
}

/// Sets the motion of a sample from the motion of the sample before it and the step in between.
/// Exponential smoothing for irregular intervals.
void MotionPredictor::follow(std::size_t index) {
  if (index == 0) return;
  Sample& sample = samples_[index];
  const bool burst = index >= 2 && sample.time_us - samples_[index - 1].time_us < min_step_us;
  const Sample& before = samples_[index - (burst ? 2 : 1)];
  const glm::dvec3 shift = shift_between(before.pose, sample.pose);
  const glm::dvec3 turn = turn_between(before.pose, sample.pose);
  const double seconds =
      seconds_between(before.time_us, std::max(sample.time_us, before.time_us + min_step_us));
  sample.speed = glm::length(shift) / seconds;
  sample.angular_speed = glm::length(turn) / seconds;
  const double smoothing_s = 1e-6 * static_cast<double>(settings_.smoothing_us);
  const double share = before.motion.known ? seconds / (seconds + smoothing_s) : 1.0;
  sample.motion = {true, glm::mix(before.motion.velocity, shift / seconds, share),
                   glm::mix(before.motion.angular_rate, turn / seconds, share)};
}

/// The first step of a motion has no step to be compared with; the second step tells whether it was
/// a jump.
void MotionPredictor::drop_a_jump_at_the_start() {
  if (samples_.size() != 3) return;
  const Sample &first = samples_[1], &second = samples_[2];
  const bool slows_down = first.speed > jump_ratio * second.speed ||
                          first.angular_speed > jump_ratio * second.angular_speed;
  if (!slows_down || extent_between(samples_[0], first) < jump_rad) return;
  samples_.erase(samples_.begin());
  samples_[0].motion = {};
  follow(1);
}

bool MotionPredictor::newest_is_a_jump() const {
  if (samples_.size() < 3) return false;  // no speed to compare with
  double speed = 0.0, angular_speed = 0.0;
  for (std::size_t i = 1; i + 1 < samples_.size(); ++i) {
    speed = std::max(speed, samples_[i].speed);
    angular_speed = std::max(angular_speed, samples_[i].angular_speed);
  }
  const Sample& newest = samples_.back();
  return (newest.speed > jump_ratio * speed || newest.angular_speed > jump_ratio * angular_speed) &&
         extent_between(samples_[samples_.size() - 2], newest) >= jump_rad;
}

/// Compares the newest sample with the forecast that the sample check_us ago implied. The forecast
/// is not damped, because the question is whether the camera keeps its velocity.
void MotionPredictor::check_forecast() {
  const Sample& newest = samples_.back();
  const double fading =
      std::exp(-seconds_between(samples_[samples_.size() - 2].time_us, newest.time_us) / fading_s);
  error_ *= fading;
  moved_ *= fading;
  const auto later =
      std::ranges::upper_bound(samples_, newest.time_us - check_us, {}, &Sample::time_us);
  if (later == samples_.begin() || !std::prev(later)->motion.known) return;
  const Sample& then = *std::prev(later);
  const double seconds = seconds_between(then.time_us, newest.time_us);
  const glm::dvec3 shift = shift_between(then.pose, newest.pose);
  const glm::dvec3 turn = turn_between(then.pose, newest.pose);
  error_ +=
      extent(shift - seconds * then.motion.velocity, turn - seconds * then.motion.angular_rate);
  moved_ += extent(shift, turn);
}

/// The angle by which a step moves a picture.
double MotionPredictor::extent(const glm::dvec3& shift, const glm::dvec3& turn) const {
  return glm::length(turn) + glm::length(shift) / settings_.lever;
}

double MotionPredictor::extent_between(const Sample& from, const Sample& to) const {
  return extent(shift_between(from.pose, to.pose), turn_between(from.pose, to.pose));
}

double MotionPredictor::confidence() const {
  const double doubt = (error_ + first_doubt * first_doubt_moved) / (moved_ + first_doubt_moved);
  return std::clamp(1.0 - doubt, settings_.min_confidence, 1.0);
}

bool MotionPredictor::still() const {
  if (samples_.empty()) return false;
  const Sample& newest = samples_.back();
  const auto later =
      std::ranges::upper_bound(samples_, newest.time_us - still_us, {}, &Sample::time_us);
  if (later == samples_.begin()) return false;  // the history is too short
  return std::all_of(std::prev(later), samples_.end(), [&](const Sample& sample) {
    return extent_between(sample, newest) <= still_rad;
  });
}

std::optional<Pose> MotionPredictor::at(std::int64_t time_us) const {
  if (samples_.empty()) return std::nullopt;
  const Sample& newest = samples_.back();
  if (samples_.size() < 3 || still()) return newest.pose;
  const std::int64_t end_us = newest.time_us + settings_.horizon_us + max_age_us;
  const double seconds =
      seconds_between(newest.time_us, std::clamp(time_us, newest.time_us, end_us));
  const double reach_s = decaying_reach_s(seconds, (1.0 - confidence()) / damping_s);
  return Pose{glm::vec3(glm::dvec3(newest.pose.position) + reach_s * newest.motion.velocity),
              rotated(newest.pose.orientation, reach_s * newest.motion.angular_rate)};
}

std::optional<Forecast> MotionPredictor::forecast(std::int64_t now_us, double rate_hz,
                                                  int frames) const {
  assert(rate_hz > 0.0 && frames >= 0);
  if (samples_.size() < 3) return std::nullopt;
  const std::int64_t age_us = now_us - samples_.back().time_us;
  if (age_us > settings_.gap_us) return std::nullopt;
  const double trust = still() ? 1.0 : std::clamp(2.0 * confidence(), least_trust, 1.0);
  const double held_us = std::min(trust * static_cast<double>(settings_.horizon_us),
                                  static_cast<double>(settings_.horizon_us + max_age_us - age_us));
  constexpr double rounding = 1e-6;
  const int held = std::clamp(static_cast<int>(1e-6 * held_us * rate_hz + rounding), 0, frames);
  return Forecast{*at(now_us + std::llround(1e6 * held / rate_hz)), held};
}

}  // namespace catgs
