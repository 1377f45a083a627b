#include "render_core/tools/trace/forecast_models.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include <glm/mat2x2.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include "render_core/motion/predictor.h"
#include "render_core/motion/rotation.h"

namespace catgs {
namespace {

/// A motion through a pose at the time of the newest sample. Rotations are about camera axes.
struct MotionEstimate {
  Pose pose;
  glm::dvec3 velocity{0.0}, angular_rate{0.0};              // units / s, rad / s
  glm::dvec3 acceleration{0.0}, angular_acceleration{0.0};  // units / s^2, rad / s^2
};

/// From samples in increasing order, at least two.
using Estimator = MotionEstimate (*)(std::span<const TimedPose>);

double seconds_between(const TimedPose& from, const TimedPose& to) {
  return 1e-6 * static_cast<double>(to.time_us - from.time_us);
}

glm::dvec3 shift_between(const Pose& from, const Pose& to) {
  return glm::dvec3(to.position) - glm::dvec3(from.position);
}

/// Sums over the last samples of a polynomial's normal equations, relative to the newest one.
struct Moments {
  double t[5] = {};                        // of time^k
  glm::dvec3 shift[3] = {}, turn[3] = {};  // of time^k times these
};

Moments moments(std::span<const TimedPose> samples, double window_s, std::size_t least) {
  const TimedPose& newest = samples.back();
  Moments sums;
  std::size_t count = 0;
  for (auto sample = samples.rbegin(); sample != samples.rend(); ++sample, ++count) {
    const double time = -seconds_between(*sample, newest);
    if (time < -window_s && count >= least) break;
    const Pose& at = newest.world_from_camera;
    const glm::dvec3 shift = shift_between(at, sample->world_from_camera);
    const glm::dvec3 turn = rotation_between(at.orientation, sample->world_from_camera.orientation);
    double power = 1.0;
    for (int k = 0; k < 5; ++k, power *= time) {
      sums.t[k] += power;
      if (k > 2) continue;
      sums.shift[k] += power * shift;
      sums.turn[k] += power * turn;
    }
  }
  return sums;
}

MotionEstimate held(std::span<const TimedPose> samples) {
  return {.pose = samples.back().world_from_camera};
}

/// Slopes of the straight lines through the samples of the last 40 ms.
MotionEstimate least_squares_line(std::span<const TimedPose> samples) {
  const Moments m = moments(samples, 0.04, 2);
  const double spread = m.t[0] * m.t[2] - m.t[1] * m.t[1];
  MotionEstimate motion = held(samples);
  motion.velocity = (m.t[0] * m.shift[1] - m.t[1] * m.shift[0]) / spread;
  motion.angular_rate = (m.t[0] * m.turn[1] - m.t[1] * m.turn[0]) / spread;
  return motion;
}

/// Parabolas through the samples of the last 150 ms.
MotionEstimate least_squares_parabola(std::span<const TimedPose> samples) {
  if (samples.size() < 3) return least_squares_line(samples);
  const Moments m = moments(samples, 0.15, 3);
  const glm::dmat3 inverse = glm::inverse(glm::dmat3(m.t[0], m.t[1], m.t[2],  //
                                                     m.t[1], m.t[2], m.t[3],  //
                                                     m.t[2], m.t[3], m.t[4]));
  const auto coefficient = [&](int k, const glm::dvec3* sums) {
    return inverse[0][k] * sums[0] + inverse[1][k] * sums[1] + inverse[2][k] * sums[2];
  };
  MotionEstimate motion = held(samples);
  motion.velocity = coefficient(1, m.shift);
  motion.angular_rate = coefficient(1, m.turn);
  motion.acceleration = 2.0 * coefficient(2, m.shift);
  motion.angular_acceleration = 2.0 * coefficient(2, m.turn);
  return motion;
}

/// The One-Euro filter (Casiez, Roussel, Vogel 2012): low-pass filters of poses and of velocities;
/// that of poses lets more through the faster they change.
MotionEstimate one_euro(std::span<const TimedPose> samples) {
  constexpr double min_cutoff_hz = 3.0, beta = 100.0, derivative_cutoff_hz = 25.0;
  const auto share = [](double cutoff_hz, double seconds) {
    const double r = 2.0 * std::numbers::pi * cutoff_hz * seconds;
    return r / (r + 1.0);
  };
  MotionEstimate motion{.pose = samples.front().world_from_camera};
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const Pose& from = samples[i - 1].world_from_camera;
    const Pose& to = samples[i].world_from_camera;
    const double seconds = seconds_between(samples[i - 1], samples[i]);
    const double follow = share(derivative_cutoff_hz, seconds);
    motion.velocity += follow * (shift_between(from, to) / seconds - motion.velocity);
    motion.angular_rate += follow * (rotation_between(from.orientation, to.orientation) / seconds -
                                     motion.angular_rate);
    const double slide = share(min_cutoff_hz + beta * glm::length(motion.velocity), seconds);
    const double turn = share(min_cutoff_hz + beta * glm::length(motion.angular_rate), seconds);
    motion.pose.position += glm::vec3(slide * shift_between(motion.pose, to));
    motion.pose.orientation = rotated(
        motion.pose.orientation, turn * rotation_between(motion.pose.orientation, to.orientation));
  }
  return motion;
}

/// Covariance of (value, rate) along any axis, for white noise as acceleration and as measurement.
class KalmanGain {
 public:
  /// Square roots of the spectral density of the acceleration (units / s^1.5) and of the variance
  /// of a measurement; `rate`: what is known of the rate at first.
  KalmanGain(double acceleration, double measurement, double rate)
      : density_(acceleration * acceleration), variance_(measurement * measurement) {
    covariance_ = glm::dmat2(variance_, 0.0, 0.0, rate * rate);
  }

  /// What share of an innovation goes to the value, and to the rate (1 / s).
  glm::dvec2 after(double seconds) {
    const glm::dmat2 transition(1.0, 0.0, seconds, 1.0);
    const double s2 = 0.5 * seconds * seconds, s3 = seconds * seconds * seconds / 3.0;
    covariance_ = transition * covariance_ * glm::transpose(transition) +
                  density_ * glm::dmat2(s3, s2, s2, seconds);
    const glm::dvec2 gain = covariance_[0] / (covariance_[0][0] + variance_);
    covariance_ -= glm::outerProduct(gain, covariance_[0]);
    return gain;
  }

 private:
  double density_, variance_;
  glm::dmat2 covariance_{0.0};
};

/// Kalman filters of a velocity that wanders, for positions and, about the estimate, for rotations.
MotionEstimate kalman(std::span<const TimedPose> samples) {
  KalmanGain slide(0.7, 0.7e-3, 2.0), turn(1.0, 1e-3, 4.0);
  MotionEstimate motion{.pose = samples.front().world_from_camera};
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const Pose& measured = samples[i].world_from_camera;
    const double seconds = seconds_between(samples[i - 1], samples[i]);
    const glm::dvec3 expected = glm::dvec3(motion.pose.position) + seconds * motion.velocity;
    const glm::quat turned = rotated(motion.pose.orientation, seconds * motion.angular_rate);
    const glm::dvec2 slide_gain = slide.after(seconds), turn_gain = turn.after(seconds);
    const glm::dvec3 off = glm::dvec3(measured.position) - expected;
    const glm::dvec3 angle_off = rotation_between(turned, measured.orientation);
    motion.pose.position = glm::vec3(expected + slide_gain.x * off);
    motion.pose.orientation = rotated(turned, turn_gain.x * angle_off);
    motion.velocity += slide_gain.y * off;
    motion.angular_rate += turn_gain.y * angle_off;
  }
  return motion;
}

/// Keeps the samples of the last while in order, late ones too, and estimates from them afresh.
class EstimatingForecaster final : public Forecaster {
 public:
  EstimatingForecaster(Estimator estimate, double damping_s)
      : estimate_(estimate), damping_s_(damping_s) {}

  void add(const TimedPose& sample) override {
    const auto place = std::ranges::lower_bound(samples_, sample.time_us, {}, &TimedPose::time_us);
    if (place != samples_.end() && place->time_us == sample.time_us) return;
    samples_.insert(place, sample);
    if (samples_.size() > max_samples) samples_.erase(samples_.begin());
    if (samples_.size() >= 2) motion_ = estimate_(samples_);
  }

  std::optional<Pose> at(std::int64_t time_us) override {
    if (!motion_) return std::nullopt;
    const double seconds =
        std::clamp(1e-6 * static_cast<double>(time_us - samples_.back().time_us), 0.0, longest_s);
    const double reach_s =
        damping_s_ > 0.0 ? damping_s_ * -std::expm1(-seconds / damping_s_) : seconds;
    const double bend = 0.5 * seconds * seconds;
    return Pose{glm::vec3(glm::dvec3(motion_->pose.position) + reach_s * motion_->velocity +
                          bend * motion_->acceleration),
                rotated(motion_->pose.orientation,
                        reach_s * motion_->angular_rate + bend * motion_->angular_acceleration)};
  }

 private:
  static constexpr std::size_t max_samples = 32;  // filters have forgotten what was before
  static constexpr double longest_s = 0.15;

  Estimator estimate_;
  double damping_s_;  // 0: none
  std::vector<TimedPose> samples_;
  std::optional<MotionEstimate> motion_;
};

class PredictorForecaster final : public Forecaster {
 public:
  void add(const TimedPose& sample) override { predictor_.add(sample); }
  std::optional<Pose> at(std::int64_t time_us) override { return predictor_.at(time_us); }

 private:
  MotionPredictor predictor_;
};

}  // namespace

std::vector<ForecastModel> forecast_models() {
  const auto model = [](std::string name, Estimator estimate, double damping_s) {
    return ForecastModel{std::move(name), [=]() -> std::unique_ptr<Forecaster> {
                           return std::make_unique<EstimatingForecaster>(estimate, damping_s);
                         }};
  };
  constexpr double damping_s = 0.3;  // best of 100…600 ms for each of them
  return {model("Held", held, 0.0),
          model("Least squares", least_squares_line, 0.0),
          model("Least squares, damped", least_squares_line, damping_s),
          model("Least squares, accelerating", least_squares_parabola, 0.0),
          model("One-Euro", one_euro, 0.0),
          model("One-Euro, damped", one_euro, damping_s),
          model("Kalman", kalman, 0.0),
          model("Kalman, damped", kalman, damping_s),
          {"MotionPredictor", [] { return std::make_unique<PredictorForecaster>(); }}};
}

}  // namespace catgs
