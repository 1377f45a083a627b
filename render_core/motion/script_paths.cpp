// The scripts that follow a path: orbit, walk and drone.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/motion/portable.h"
#include "render_core/motion/script_parts.h"

namespace catgs {
namespace {

constexpr double degree = std::numbers::pi / 180.0;

/// Uniform cubic B-spline that begins at its first point. It stays in the convex hull of its points
/// and is twice differentiable, so that a path inside a box has smooth speed and smooth turns.
class SmoothPath {
 public:
  struct Sample {
    glm::dvec3 position, velocity, acceleration;  // world units, seconds
  };

  SmoothPath(std::vector<glm::dvec3> points, double knot_s)
      : points_(std::move(points)), knot_s_(knot_s) {
    points_.insert(points_.begin(), 2.0 * points_[0] - points_[1]);  // makes it begin at points[0]
  }

  [[nodiscard]] Sample at(double time_s) const {
    const double last = static_cast<double>(points_.size() - 4);
    const double x = std::clamp(time_s / knot_s_, 0.0, last + 1.0);
    const double segment = std::min(std::floor(x), last);
    const double t = x - segment;
    const glm::dvec3* p = points_.data() + static_cast<std::size_t>(segment);
    const glm::dvec3 d0 = p[1] - p[0], d1 = p[2] - p[1], d2 = p[3] - p[2];
    const double s = 1.0 - t;
    Sample sample;
    sample.position = (s * s * s * p[0] + (3.0 * t * t * t - 6.0 * t * t + 4.0) * p[1] +
                       (3.0 * s * s * s - 6.0 * s * s + 4.0) * p[2] + t * t * t * p[3]) /
                      6.0;
    sample.velocity = (0.5 * s * s * d0 + (0.5 + t - t * t) * d1 + 0.5 * t * t * d2) / knot_s_;
    sample.acceleration = (s * (d1 - d0) + t * (d2 - d1)) / (knot_s_ * knot_s_);
    return sample;
  }

 private:
  std::vector<glm::dvec3> points_;
  double knot_s_;
};

struct Wander {
  double speed_m_s;
  double step_s;
  double climb;  // largest slope; 0 keeps the height
};

/// A path from the start pose that steers towards one random place after another, with turns gentle
/// enough to look ahead along it.
SmoothPath wander(const SceneFrame& frame, const Wander& how, PortableRng& rng, double duration_s) {
  constexpr double sharpest_turn = 45.0 * degree;  // per step
  const SinCos<double> turn = portable_sincos(sharpest_turn);
  // A small scene is crossed more slowly, not with sharper turns.
  const double step = std::min(how.speed_m_s * how.step_s * frame.metre(), 0.08 * frame.extent());
  const auto random_position = [&] {  // far enough from the limits to turn before them
    const glm::dvec3 share{rng.uniform(0.2, 0.8), rng.uniform(0.2, 0.8), rng.uniform(0.2, 0.8)};
    return glm::mix(frame.low(), frame.high(), share);
  };
  std::vector<glm::dvec3> points{frame.inside(frame.start())};
  glm::dvec2 heading(0.0, 1.0);  // ground axes: right, forward
  glm::dvec3 target = random_position();
  while (static_cast<double>(points.size()) < duration_s / how.step_s + 4.0) {
    const glm::dvec3 ahead = target - points.back();
    const glm::dvec2 wish(glm::dot(ahead, frame.right()), glm::dot(ahead, frame.forward()));
    const double distance = glm::length(wish);
    if (distance < 3.0 * step) target = random_position();
    const glm::dvec2 aim = distance > 0.0 ? wish / distance : heading;
    const double to_the_right = heading.y * aim.x - heading.x * aim.y;
    const double sine = std::copysign(turn.sin, to_the_right);
    heading = glm::dot(heading, aim) >= turn.cos
                  ? aim
                  : glm::dvec2(heading.x * turn.cos + heading.y * sine,
                               heading.y * turn.cos - heading.x * sine);
    const double rise =
        std::clamp(glm::dot(ahead, frame.up()), -how.climb * step, how.climb * step);
    points.push_back(points.back() + frame.up() * rise +
                     step * (heading.x * frame.right() + heading.y * frame.forward()));
  }
  return {std::move(points), how.step_s};
}

}  // namespace

PoseAt walk_script(const SceneFrame& frame, std::uint64_t seed, double duration_s) {
  PortableRng rng(seed);
  const SmoothPath path =
      wander(frame, {.speed_m_s = 1.2, .step_s = 0.6, .climb = 0.0}, rng, duration_s);
  const std::uint64_t noise_seed = rng.next();
  return [=](double time_s) {
    constexpr double steps_per_s = 1.8;
    const SmoothPath::Sample sample = path.at(time_s);
    const double phase = 2.0 * std::numbers::pi * steps_per_s * time_s;
    const double bob_m = 0.02 * portable_sincos(phase).sin;
    const double sway_m = 0.015 * portable_sincos(0.5 * phase).sin;
    const glm::dvec3 side = glm::cross(sample.velocity, frame.up());
    const glm::dvec3 position = sample.position + frame.metre() * bob_m * frame.up() +
                                frame.metre() * sway_m * side / std::max(glm::length(side), 1e-9);
    // Glances to the side and down while the body follows the path.
    const double glance = 30.0 * degree * value_noise(noise_seed, 0, 0.5 * time_s);
    const double nod = (-5.0 + 8.0 * value_noise(noise_seed, 1, 0.4 * time_s)) * degree;
    const SinCos<double> turn = portable_sincos(glance);
    const SinCos<double> slope = portable_sincos(nod);
    const double speed = glm::length(sample.velocity);
    const glm::dvec3 view =
        slope.cos * (turn.cos * sample.velocity + turn.sin * side) + slope.sin * speed * frame.up();
    return frame.look_along(position, view, frame.up());
  };
}

PoseAt drone_script(const SceneFrame& frame, std::uint64_t seed, double duration_s) {
  PortableRng rng(seed);
  const SmoothPath path =
      wander(frame, {.speed_m_s = 3.0, .step_s = 0.8, .climb = 0.3}, rng, duration_s);
  return [=](double time_s) {
    constexpr double gravity_m_s2 = 9.81;
    const SinCos<double> dive = portable_sincos(-10.0 * degree);  // looks slightly down
    const SmoothPath::Sample sample = path.at(time_s);
    const double speed = glm::length(sample.velocity);
    const glm::dvec3 view = dive.cos * sample.velocity + dive.sin * speed * frame.up();
    // Banked like an aircraft in a coordinated turn: its up is opposite to the force on its
    // passengers.
    const glm::dvec3 up = gravity_m_s2 * frame.metre() * frame.up() + sample.acceleration;
    return frame.look_along(sample.position, view, up);
  };
}

PoseAt circle(const SceneFrame& frame, const std::function<double(double time_s)>& angle_rad) {
  const glm::dvec3 arm = frame.start() - frame.focus();
  const glm::dvec3 rise = frame.up() * glm::dot(arm, frame.up());
  glm::dvec3 radius = arm - rise;
  if (glm::length(radius) < 0.1 * frame.metre()) radius = -frame.metre() * frame.forward();
  const glm::dvec3 across = glm::cross(frame.up(), radius);
  return [=](double time_s) {
    const SinCos<double> angle = portable_sincos(angle_rad(time_s));
    const glm::dvec3 position =
        frame.inside(frame.focus() + rise + angle.cos * radius + angle.sin * across);
    return frame.look_along(position, frame.focus() - position, frame.up());
  };
}

PoseAt orbit_script(const SceneFrame& frame, std::uint64_t seed) {
  PortableRng rng(seed);
  const double direction = rng.coin() ? 1.0 : -1.0;
  const double period_s = rng.uniform(16.0, 24.0);
  return circle(
      frame, [=](double time_s) { return direction * 2.0 * std::numbers::pi * time_s / period_s; });
}

}  // namespace catgs
