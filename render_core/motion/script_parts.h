#pragma once

#include <functional>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include "render_core/motion/script.h"

namespace catgs {

/// A script: the camera at a time in seconds, defined over the whole duration.
using PoseAt = std::function<Pose(double time_s)>;

/// The place where a script plays: the scene's ground axes, scale and limits, in double precision.
///
/// Ground axes are those of a level camera at the start pose: x right, y down (against the scene's
/// up), z forward. Human-sized motion is multiplied by `metre`. A scene whose horizontal limits are
/// narrower than four metres counts as a miniature.
class SceneFrame {
 public:
  explicit SceneFrame(const SceneHints& hints);

  [[nodiscard]] double metre() const { return metre_; }    // world units
  [[nodiscard]] double extent() const { return extent_; }  // narrowest horizontal side, world units
  [[nodiscard]] glm::dvec3 start() const { return start_; }
  [[nodiscard]] glm::dvec3 focus() const { return focus_; }
  [[nodiscard]] glm::dvec3 low() const { return low_; }
  [[nodiscard]] glm::dvec3 high() const { return high_; }
  [[nodiscard]] glm::dvec3 right() const { return right_; }
  [[nodiscard]] glm::dvec3 up() const { return up_; }
  [[nodiscard]] glm::dvec3 forward() const { return forward_; }
  [[nodiscard]] glm::dquat world_from_ground() const { return level_; }
  /// Start pose as it is, rotation included.
  [[nodiscard]] glm::dquat start_orientation() const { return start_orientation_; }
  /// The start pose's view, with its image made upright and then turned, in radians: yaw about the
  /// scene's up (to the right), then pitch (upwards), then roll (clockwise) in camera axes.
  [[nodiscard]] glm::dquat turned(const glm::dvec3& yaw_pitch_roll_rad) const;

  /// Bends a position into the limits: unchanged in the middle, ever slower towards a limit, which
  /// is never reached. Its derivative is continuous, so that motion stays smooth.
  [[nodiscard]] glm::dvec3 inside(const glm::dvec3& position) const;

  /// Camera at `position` (bent into the limits) that looks along `view` with its image upright
  /// with respect to `up`; neither needs unit length. A view along `up` falls back to the start's.
  [[nodiscard]] Pose look_along(const glm::dvec3& position, const glm::dvec3& view,
                                const glm::dvec3& up) const;

 private:
  glm::dvec3 right_, up_, forward_, start_, focus_, low_, high_;
  glm::dquat start_orientation_;
  glm::dquat level_;    // ground axes to world
  glm::dquat upright_;  // start view without roll, in ground axes
  double extent_ = 0.0;
  double metre_ = 1.0;
};

/// Poses at `rate_hz` from time 0 over the duration. Throws InputError naming --duration or --fps.
Trajectory sample(const PoseAt& pose_at, double duration_s, double rate_hz);

/// A circle around the focus that begins at the start pose and always looks at the focus. At a time
/// it has turned by `angle_rad` (to the left as seen from above).
PoseAt circle(const SceneFrame& frame, const std::function<double(double time_s)>& angle_rad);

/// A person looking around: turns of the head with fixations between, leaning, stepping.
PoseAt head_script(const SceneFrame& frame, std::uint64_t seed, double duration_s);
/// A walk at the start pose's eye height through the limits.
PoseAt walk_script(const SceneFrame& frame, std::uint64_t seed, double duration_s);
/// A smooth, banked flight through the limits.
PoseAt drone_script(const SceneFrame& frame, std::uint64_t seed, double duration_s);
/// A circle() in about twenty seconds.
PoseAt orbit_script(const SceneFrame& frame, std::uint64_t seed);
/// Smooth flight through keyframes at their own times; stays at the last.
PoseAt tour_script(const SceneFrame& frame, const Trajectory& keyframes);

}  // namespace catgs
