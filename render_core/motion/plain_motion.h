#pragma once

#include <optional>
#include <string_view>

#include "render_core/motion/trajectory.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// A single kind of camera motion at one speed: the paper's panning, zooming and rotation (3.1.1)
/// and an orbit. All begin at a scene's start pose, its image made upright:
///
///   pan     sideways, to and fro, view direction held; world units / s
///   zoom    along the view, to and fro; world units / s
///   rotate  on the spot about the scene's up, all around; rad / s
///   orbit   around the scene's focus at the start pose's height and distance, looking at it; rad /
///   s
enum class MotionKind { pan, zoom, rotate, orbit };

struct PlainMotion {
  MotionKind kind = MotionKind::pan;
  double speed = 1.0;  // see MotionKind
  double duration_s = 10.0;
  double rate_hz = 120.0;
  std::optional<double> reach{};  // pan, zoom: to both sides; default: as far as `bounds`
};

/// Poses at `rate_hz` from time 0. Without a reach, pan and zoom turn back 2 % of the way before
/// they would leave `bounds`. Throws InputError for a speed, duration or rate out of range. Throws
/// also for a start outside of `bounds`, where no default reach exists.
Trajectory make_plain_motion(const PlainMotion& motion, const SceneHints& hints,
                             const Bounds& bounds);

}  // namespace catgs
