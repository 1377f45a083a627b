#pragma once

#include <cstdint>
#include <optional>

#include "render_core/motion/predictor.h"
#include "server/net/messages.h"

namespace catgs {

/// Forecasts a client's camera. It follows the path that the client announced while poses keep to
/// it, and extrapolates the motion otherwise. Times are on the client's clock.
class CameraForecast {
 public:
  /// Starts without any motion, in a scene with this near plane.
  explicit CameraForecast(float near_z = 0.2f);

  /// Replaces the previous path; an empty one ends it.
  void follow(const PosePath& path);
  void add(const TimedPose& sample);

  /// See MotionPredictor.
  [[nodiscard]] std::optional<Pose> at(std::int64_t time_us) const;
  /// See MotionPredictor. A path tells where the camera is until it ends.
  [[nodiscard]] std::optional<Forecast> forecast(std::int64_t now_us, double rate_hz,
                                                 int frames) const;

 private:
  [[nodiscard]] bool on_path(std::int64_t time_us) const;

  float near_z_;
  MotionPredictor predictor_;
  Trajectory path_;  // empty: none, or the camera has left it
};

}  // namespace catgs
