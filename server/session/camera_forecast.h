#pragma once

#include <cstdint>
#include <optional>

#include "render_core/motion/predictor.h"
#include "server/net/messages.h"

namespace catgs {

/// Where a client's camera will be: on the path that it announced, as long as its poses keep to it,
/// and otherwise where the motion so far leads. Times are on the client's clock.
class CameraForecast {
 public:
  /// Knows nothing yet of the motion through a scene with this near plane.
  explicit CameraForecast(float near_z = 0.2f);

  /// Takes the place of the path before; an empty one ends it.
  void follow(const PosePath& path);
  void add(const TimedPose& sample);

  /// See MotionPredictor.
  [[nodiscard]] std::optional<Pose> at(std::int64_t time_us) const;
  [[nodiscard]] std::optional<Forecast> forecast(std::int64_t now_us, double rate_hz,
                                                 int frames) const;

 private:
  [[nodiscard]] bool on_path(std::int64_t time_us) const;

  float near_z_;
  MotionPredictor predictor_;
  Trajectory path_;  // empty: none, or the camera has left it
};

}  // namespace catgs
