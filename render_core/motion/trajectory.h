#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "render_core/math/camera.h"

namespace catgs {

/// A pose and the time at which the camera was there.
struct TimedPose {
  std::int64_t time_us = 0;
  Pose world_from_camera;
};

/// Poses in strictly increasing time order.
using Trajectory = std::vector<TimedPose>;

/// Reads a TUM file: `timestamp_s tx ty tz qx qy qz qw` on each line, '#' starts a comment.
/// Quaternions are normalised. Throws InputError with the line of a mistake. The trajectory is
/// about `origin`; the file counts from 0.
Trajectory read_tum(const std::filesystem::path& path, const glm::dvec3& origin = glm::dvec3(0.0));
void write_tum(const std::filesystem::path& path, const Trajectory& trajectory,
               const glm::dvec3& origin = glm::dvec3(0.0));

/// Pose at `time_us`: linear in position, slerp in orientation, clamped to the ends. It uses the
/// sample after `time_us`, so it serves display and resampling, never a forecast.
Pose interpolate(const Trajectory& trajectory, std::int64_t time_us);

/// The trajectory sampled at `rate_hz` from its first to its last pose, by interpolate().
Trajectory resample(const Trajectory& trajectory, double rate_hz);

}  // namespace catgs
