#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "render_core/motion/predictor.h"

namespace catgs {

/// A way to forecast.
struct ForecastModel {
  std::string name;
  PredictorSettings settings{};
  bool holds = false;  // keeps the newest sample's pose, whatever the settings
};

/// The models that `trace forecast` compares: no forecast, constant velocity (the paper's way), and
/// the server's.
std::vector<ForecastModel> forecast_models();

/// How the samples of a recorded motion reach the predictor, and which forecasts are asked for.
struct ForecastTrial {
  // Rate at which a client reads the tracker. It sends the newest sample, with that sample's stamp,
  // unless it has sent it before. 0: every sample is sent when it is taken.
  double input_hz = 0.0;
  double jitter_ms = 20.0;  // a sample travels for 0 to this long
  std::uint64_t seed = 1;   // of the jitter
  double asked_hz = 120.0;  // rate of the forecasts
  std::vector<std::int64_t> horizons_us{8'000, 16'000, 33'000, 66'000, 100'000};  // ahead of now
};

struct Arrival {
  std::int64_t time_us = 0;
  TimedPose sample;
};

/// The samples in order of arrival, which jitter may change. The samples that have arrived at some
/// time do not depend on any with a later stamp.
std::vector<Arrival> deliver(const Trajectory& recorded, const ForecastTrial& trial);

/// Asks for forecasts from 0.5 s after the first sample on, as long as the recording has the true
/// poses. Before each forecast the model is given the samples that have arrived by then, and
/// nothing else. Calls visit(now_us, index of the horizon, forecast).
using VisitForecast =
    std::function<void(std::int64_t now_us, std::size_t horizon, const Pose& forecast)>;
void replay(const Trajectory& recorded, const ForecastTrial& trial, const ForecastModel& model,
            const VisitForecast& visit);

/// Distance in pixels between the images of points from the forecast camera and from the true one.
/// It is the mean over the centres of a 4x4 division of the true image, at depths of 1, 3 and 10
/// world units. Each distance is limited to the image's diagonal, which also counts for a point
/// that is not in front of the forecast camera. `lens`: its pose is not used.
double forecast_error_px(const Camera& lens, const Pose& truth, const Pose& forecast);

/// The angle between two orientations, degrees.
double forecast_error_deg(const Pose& truth, const Pose& forecast);

struct ForecastErrors {
  std::vector<double> px, deg;  // one per forecast
};

/// The errors at each horizon.
std::vector<ForecastErrors> judge_forecasts(const Trajectory& recorded, const ForecastTrial& trial,
                                            const Camera& lens, const ForecastModel& model);

}  // namespace catgs
