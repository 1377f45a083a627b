#include "server/flow/camera_forecast.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace catgs {
namespace {

// A camera farther than this from its path has left it: the user took over. A path is sampled with
// straight lines between samples, so poses never lie exactly on it.
constexpr float path_angle_rad = 0.05f;
constexpr float path_distance_near_z = 1.0f;  // in near planes

bool close_by(const Pose& a, const Pose& b, float near_z) {
  const float half_cosine = std::abs(glm::dot(a.orientation, b.orientation));
  return half_cosine >= std::cos(0.5f * path_angle_rad) &&
         glm::distance(a.position, b.position) <= path_distance_near_z * near_z;
}

}  // namespace

CameraForecast::CameraForecast(float near_z)
    : near_z_(near_z), predictor_({.lever = forecast_lever(near_z)}) {}

void CameraForecast::follow(const PosePath& path) {
  path_.clear();
  for (const PoseSample& sample : path.samples)
    if (path_.empty() || sample.client_time_us > path_.back().time_us)
      path_.push_back({sample.client_time_us, sample.world_from_camera});
}

void CameraForecast::add(const TimedPose& sample) {
  predictor_.add(sample);
  if (path_.empty() || sample.time_us < path_.front().time_us) return;
  if (!on_path(sample.time_us) ||
      !close_by(interpolate(path_, sample.time_us), sample.world_from_camera, near_z_))
    path_.clear();
}

bool CameraForecast::on_path(std::int64_t time_us) const {
  return !path_.empty() && time_us >= path_.front().time_us && time_us <= path_.back().time_us;
}

std::optional<Pose> CameraForecast::at(std::int64_t time_us) const {
  if (on_path(time_us)) return interpolate(path_, time_us);
  return predictor_.at(time_us);
}

std::optional<Forecast> CameraForecast::forecast(std::int64_t now_us, double rate_hz,
                                                 int frames) const {
  if (!on_path(now_us)) return predictor_.forecast(now_us, rate_hz, frames);
  const double left_s = 1e-6 * static_cast<double>(path_.back().time_us - now_us);
  constexpr double rounding = 1e-6;
  const int held = std::min(frames, static_cast<int>(left_s * rate_hz + rounding));
  return Forecast{interpolate(path_, now_us + std::llround(1e6 * held / rate_hz)), held};
}

}  // namespace catgs
