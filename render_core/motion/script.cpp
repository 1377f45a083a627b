#include "render_core/motion/script.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/base/error.h"
#include "render_core/motion/camera_path.h"
#include "render_core/motion/portable.h"
#include "render_core/motion/script_parts.h"

namespace catgs {
namespace {

constexpr double max_duration_s = 24 * 3600.0;
constexpr double max_rate_hz = 1000.0;

/// Too close to vertical to have a heading. `up` is a unit vector.
bool is_steep(const glm::dvec3& direction, const glm::dvec3& up) {
  return std::abs(glm::dot(direction, up)) >= 0.999 * glm::length(direction);
}

/// Camera-to-world rotation that looks along `view` with its image upright with respect to `up`.
glm::dquat upright_view(const glm::dvec3& view, const glm::dvec3& up) {
  const glm::dvec3 z = glm::normalize(view);
  const glm::dvec3 x = glm::normalize(glm::cross(z, up));
  return glm::quat_cast(glm::dmat3(x, glm::cross(z, x), z));
}

double soft_limit(double value, double low, double high) {
  const double middle = 0.5 * (low + high);
  const double half = 0.5 * (high - low);
  if (half <= 0.0) return middle;
  const double free = 0.8 * half;  // motion slows down in the rest
  const double excess = std::abs(value - middle) - free;
  if (excess <= 0.0) return value;
  const double room = half - free;
  return middle + std::copysign(free + room * excess / (room + excess), value - middle);
}

void check_sampling(double duration_s, double rate_hz) {
  if (!(duration_s > 0.0 && duration_s <= max_duration_s)) {
    throw InputError("--duration", "", "must be above 0 s and at most a day");
  }
  if (!(rate_hz > 0.0 && rate_hz <= max_rate_hz)) {
    throw InputError("--fps", "", fmt::format("must be above 0 and at most {} Hz", max_rate_hz));
  }
}

PoseAt make_pose_at(const ScriptOptions& options, const SceneFrame& frame,
                    const glm::dvec3& origin) {
  const std::string_view script = options.script;
  if (script == "orbit") return orbit_script(frame, options.seed);
  if (script == "walk") return walk_script(frame, options.seed, options.duration_s);
  if (script == "head") return head_script(frame, options.seed, options.duration_s);
  if (script == "drone") return drone_script(frame, options.seed, options.duration_s);
  if (script == "still") {
    const Pose pose{frame.inside(frame.start()), glm::quat(frame.start_orientation())};
    return [pose](double) { return pose; };
  }
  if (const auto file = tour_file(script))
    return tour_script(frame, read_camera_path(*file).poses_about(origin));
  throw InputError("--script", "", fmt::format("unknown script \"{}\"", script),
                   "one of orbit, walk, head, drone, still, tour:FILE");
}

}  // namespace

SceneFrame::SceneFrame(const SceneHints& hints)
    : up_(glm::normalize(glm::dvec3(hints.up))),
      start_(hints.start_pose.position),
      focus_(hints.focus),
      low_(hints.limits.min),
      high_(hints.limits.max),
      start_orientation_(glm::normalize(glm::dquat(hints.start_pose.orientation))) {
  const glm::dvec3 view = start_orientation_ * glm::dvec3(0.0, 0.0, 1.0);
  const bool steep = is_steep(view, up_);
  const glm::dvec3 ahead = steep ? start_orientation_ * glm::dvec3(0.0, -1.0, 0.0) : view;
  forward_ = glm::normalize(ahead - up_ * glm::dot(ahead, up_));
  right_ = glm::cross(forward_, up_);
  level_ = upright_view(forward_, up_);
  upright_ = glm::conjugate(level_) * (steep ? start_orientation_ : upright_view(view, up_));
  const glm::dvec3 size = glm::max(high_ - low_, glm::dvec3(0.0));
  extent_ = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(up_[axis]) < 0.8) extent_ = std::min(extent_, size[axis]);
  }
  metre_ = std::min(1.0, extent_ / 4.0);
}

glm::dquat SceneFrame::turned(const glm::dvec3& yaw_pitch_roll_rad) const {
  const SinCos<double> yaw = portable_sincos(0.5 * yaw_pitch_roll_rad.x);
  const SinCos<double> pitch = portable_sincos(0.5 * yaw_pitch_roll_rad.y);
  const SinCos<double> roll = portable_sincos(0.5 * yaw_pitch_roll_rad.z);
  // glm's constructor order: w, x, y, z.
  return level_ * glm::dquat(yaw.cos, 0.0, yaw.sin, 0.0) * upright_ *
         glm::dquat(pitch.cos, pitch.sin, 0.0, 0.0) * glm::dquat(roll.cos, 0.0, 0.0, roll.sin);
}

glm::dvec3 SceneFrame::inside(const glm::dvec3& position) const {
  return {soft_limit(position.x, low_.x, high_.x), soft_limit(position.y, low_.y, high_.y),
          soft_limit(position.z, low_.z, high_.z)};
}

Pose SceneFrame::look_along(const glm::dvec3& position, const glm::dvec3& view,
                            const glm::dvec3& up) const {
  const bool usable = glm::length(view) > 0.0 && !is_steep(view, glm::normalize(up));
  return {inside(position), glm::quat(usable ? upright_view(view, up) : start_orientation_)};
}

Trajectory sample(const PoseAt& pose_at, double duration_s, double rate_hz) {
  check_sampling(duration_s, rate_hz);
  const auto count = static_cast<std::int64_t>(std::ceil(duration_s * rate_hz));
  Trajectory trajectory;
  trajectory.reserve(static_cast<std::size_t>(count));
  for (std::int64_t i = 0; i < count; ++i) {
    const double time_s = static_cast<double>(i) / rate_hz;
    Pose pose = pose_at(time_s);
    // q and -q are the same rotation; neighbours of one sign keep the file easy to resample.
    if (!trajectory.empty() &&
        glm::dot(trajectory.back().world_from_camera.orientation, pose.orientation) < 0.0f) {
      pose.orientation = -pose.orientation;
    }
    trajectory.push_back({static_cast<std::int64_t>(time_s * 1e6 + 0.5), pose});
  }
  return trajectory;
}

std::optional<std::string_view> tour_file(std::string_view script) {
  constexpr std::string_view prefix = "tour:";
  if (!script.starts_with(prefix)) return std::nullopt;
  if (script == prefix)
    throw InputError("--script", "", "tour: names no file",
                     "tour:FILE, a camera path of keyframes");
  return script.substr(prefix.size());
}

Trajectory make_script(const ScriptOptions& options, const SceneHints& hints) {
  check_sampling(options.duration_s, options.rate_hz);  // a script plans its whole duration
  return sample(make_pose_at(options, SceneFrame(hints), hints.origin), options.duration_s,
                options.rate_hz);
}

}  // namespace catgs
