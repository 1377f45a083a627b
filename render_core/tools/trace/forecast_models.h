#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render_core/motion/trajectory.h"

namespace catgs {

/// Tells where a camera will be from the samples that it has been given, in the order in which they
/// arrived.
class Forecaster {
 public:
  Forecaster() = default;
  Forecaster(const Forecaster&) = delete;
  Forecaster& operator=(const Forecaster&) = delete;
  virtual ~Forecaster() = default;

  virtual void add(const TimedPose& sample) = 0;
  /// Nothing before it can tell.
  [[nodiscard]] virtual std::optional<Pose> at(std::int64_t time_us) = 0;
};

struct ForecastModel {
  std::string name;
  std::function<std::unique_ptr<Forecaster>()> make;
};

/// What `trace forecast` compares: no forecast, the textbook's ways, each at the parameters that
/// serve recorded head motion best, and MotionPredictor, which is the last.
std::vector<ForecastModel> forecast_models();

}  // namespace catgs
