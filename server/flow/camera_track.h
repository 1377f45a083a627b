#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "server/flow/camera_forecast.h"

namespace catgs {

/// Tracks one client's camera: its newest pose, and the forecast for when a picture drawn now is
/// seen. Times are on the client's clock. Pure; not thread-safe.
class CameraTrack {
 public:
  /// Starts without any pose, in a scene with this near plane.
  explicit CameraTrack(float near_z = 0.2f) : forecast_(near_z) {}

  /// Adds a pose whose picture will be seen `ahead` after its sample. False: a newer pose is known,
  /// since ids increase.
  bool add(const PoseSample& sample, std::chrono::microseconds ahead) {
    if (newest_ && sample.pose_id <= newest_->pose_id) return false;
    newest_ = sample;
    forecast_.add({sample.client_time_us, sample.world_from_camera});
    aim_ = sample;
    seen_us_ = sample.client_time_us + ahead.count();
    if (const auto then = forecast_.at(seen_us_)) aim_.world_from_camera = *then;
    return true;
  }
  void follow(const PosePath& path) { forecast_.follow(path); }
  /// The client's ids and times restart.
  void begin_anew() {
    newest_.reset();
    forecast_.follow({});
  }

  [[nodiscard]] const std::optional<PoseSample>& newest() const { return newest_; }
  /// The newest pose, with the camera moved to where it will be when the picture is seen.
  [[nodiscard]] const PoseSample& aim() const { return aim_; }
  /// The camera so long after the newest pose, if that can be told.
  [[nodiscard]] std::optional<Pose> ahead(std::chrono::microseconds time) const {
    return newest_ ? forecast_.at(newest_->client_time_us + time.count()) : std::nullopt;
  }
  /// The camera from aim() on, over so many frames.
  [[nodiscard]] std::optional<Forecast> forecast(double rate_hz, int frames) const {
    return forecast_.forecast(seen_us_, rate_hz, frames);
  }
  /// Aims at the newest pose itself, because the camera stands still.
  void aim_at_newest() {
    aim_ = *newest_;
    seen_us_ = aim_.client_time_us;
  }

 private:
  CameraForecast forecast_;
  std::optional<PoseSample> newest_;
  PoseSample aim_;
  std::int64_t seen_us_ = 0;  // when the picture of aim_ is
};

}  // namespace catgs
