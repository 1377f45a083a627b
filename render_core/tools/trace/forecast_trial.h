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
  bool holds = false;  // the newest sample's pose, whatever the settings
};

/// What `trace forecast` compares: no forecast, constant velocity (the paper's way), and what the
/// server does.
std::vector<ForecastModel> forecast_models();

/// How a recorded motion reaches the one who forecasts, and what is asked.
struct ForecastTrial {
  // A client that looks at the tracker so often and sends the newest sample, with that sample's
  // stamp, unless it has sent it before. 0: every sample when it is taken.
  double input_hz = 0.0;
  double jitter_ms = 20.0;  // a sample is under way for 0 to this long
  std::uint64_t seed = 1;   // of the jitter
  double asked_hz = 120.0;  // forecasts are asked for so often,
  std::vector<std::int64_t> horizons_us{8'000, 16'000, 33'000, 66'000, 100'000};  // so far ahead
};

struct Arrival {
  std::int64_t time_us = 0;
  TimedPose sample;
};

/// The samples in the order in which they arrive, which jitter may turn around. What arrives until
/// some time depends on no sample with a later stamp.
std::vector<Arrival> deliver(const Trajectory& recorded, const ForecastTrial& trial);

/// Asks for forecasts from 0.5 s after the first sample on, as long as the recording tells what
/// came true; before each, the model is given what has arrived by then and nothing else. Calls
/// visit(now_us, index of the horizon, forecast).
using VisitForecast =
    std::function<void(std::int64_t now_us, std::size_t horizon, const Pose& forecast)>;
void replay(const Trajectory& recorded, const ForecastTrial& trial, const ForecastModel& model,
            const VisitForecast& visit);

/// How far the images of points from the forecast camera lie from their true ones, in pixels: the
/// mean over the centres of a 4x4 division of the true image, at depths of 1, 3 and 10 world units.
/// What is no longer in front of the forecast camera counts as the image's diagonal, which is the
/// most that counts. `lens`: its pose is not used.
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
