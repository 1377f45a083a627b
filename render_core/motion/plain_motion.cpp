#include "render_core/motion/plain_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "render_core/base/error.h"
#include "render_core/motion/portable.h"
#include "render_core/motion/script_parts.h"

namespace catgs {
namespace {

/// The free distance from the start, backwards (<= 0) and forwards (>= 0).
struct Range {
  double low, high;
};

/// The part of the line from `start` along the unit vector `axis` that is in the box.
Range range_in(const Bounds& bounds, const glm::dvec3& start, const glm::dvec3& axis) {
  constexpr double margin = 0.98;
  Range range{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  for (int i = 0; i < 3; ++i) {
    const double below = bounds.min[i] - start[i];
    const double above = bounds.max[i] - start[i];
    if (below > 0.0 || above < 0.0) {
      throw InputError("--reach", "", "the start pose lies outside of the scene's 5-95 % bounds",
                       "say how far the camera may go, in world units");
    }
    if (axis[i] == 0.0) continue;
    range.low = std::max(range.low, std::min(below / axis[i], above / axis[i]));
    range.high = std::min(range.high, std::max(below / axis[i], above / axis[i]));
  }
  return {margin * range.low, margin * range.high};
}

/// A point that goes to and fro in the range at a speed of 1, forwards first: a triangle wave.
double to_and_fro(const Range& range, double way) {
  const double length = range.high - range.low;
  if (!(length > 0.0)) return 0.0;
  const double phase = std::fmod(way - range.low, 2.0 * length);
  return range.low + (phase <= length ? phase : 2.0 * length - phase);
}

Pose straight_pose(const PlainMotion& motion, const SceneFrame& frame, const Range& range,
                   const glm::dvec3& axis, double time_s) {
  const glm::dvec3 position = frame.start() + axis * to_and_fro(range, motion.speed * time_s);
  return {glm::vec3(position), glm::quat(frame.turned(glm::dvec3(0.0)))};
}

PoseAt pose_of(const PlainMotion& motion, const SceneFrame& frame, const Bounds& bounds) {
  switch (motion.kind) {
    case MotionKind::rotate:
      return [=](double time_s) {
        return Pose{glm::vec3(frame.start()),
                    glm::quat(frame.turned({motion.speed * time_s, 0.0, 0.0}))};
      };
    case MotionKind::orbit:
      return circle(frame, [=](double time_s) { return motion.speed * time_s; });
    case MotionKind::pan:
    case MotionKind::zoom:
      break;
  }
  const glm::dvec3 axis =
      frame.turned(glm::dvec3(0.0)) *
      (motion.kind == MotionKind::pan ? glm::dvec3(1.0, 0.0, 0.0) : glm::dvec3(0.0, 0.0, 1.0));
  const Range range =
      motion.reach ? Range{-*motion.reach, *motion.reach} : range_in(bounds, frame.start(), axis);
  return [=](double time_s) { return straight_pose(motion, frame, range, axis, time_s); };
}

}  // namespace

Trajectory make_plain_motion(const PlainMotion& motion, const SceneHints& hints,
                             const Bounds& bounds) {
  constexpr double max_speed = 1e6;
  if (!(motion.speed > 0.0 && motion.speed <= max_speed)) {
    throw InputError("--speed", "", "is out of range",
                     fmt::format("above 0, at most {}", max_speed));
  }
  if (motion.reach && !(*motion.reach > 0.0 && std::isfinite(*motion.reach))) {
    throw InputError("--reach", "", "is out of range", "a positive number of world units");
  }
  return sample(pose_of(motion, SceneFrame(hints), bounds), motion.duration_s, motion.rate_hz);
}

}  // namespace catgs
