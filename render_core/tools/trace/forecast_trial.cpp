#include "render_core/tools/trace/forecast_trial.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "render_core/base/portable.h"
#include "render_core/math/camera-inl.h"
#include "render_core/motion/rotation.h"

namespace catgs {
namespace {

constexpr std::int64_t settling_us = 500'000;
constexpr std::array<double, 3> depths = {1.0, 3.0, 10.0};
constexpr int points_per_side = 4;

/// Calls visit(time_us) at `rate_hz` from the first sample to the last.
template <class Visit>
void for_each_tick(const Trajectory& recorded, double rate_hz, const Visit& visit) {
  const std::int64_t first_us = recorded.front().time_us;
  for (std::int64_t tick = 0;; ++tick) {
    const std::int64_t time_us = first_us + std::llround(1e6 * static_cast<double>(tick) / rate_hz);
    if (time_us > recorded.back().time_us) return;
    visit(time_us);
  }
}

}  // namespace

std::vector<ForecastModel> forecast_models() {
  return {{.name = "Held", .holds = true},
          {.name = "Constant velocity", .settings = {.min_confidence = 1.0}},
          {.name = "MotionPredictor"}};
}

std::vector<Arrival> deliver(const Trajectory& recorded, const ForecastTrial& trial) {
  std::vector<Arrival> arrivals;
  SplitMix64 random(trial.seed);
  const auto send = [&](std::int64_t time_us, const TimedPose& sample) {
    const double share = static_cast<double>(random.next() >> 11) * 0x1p-53;
    arrivals.push_back({time_us + std::llround(1e3 * trial.jitter_ms * share), sample});
  };
  if (trial.input_hz > 0.0) {
    std::size_t taken = 0, sent = 0;  // numbers of samples
    for_each_tick(recorded, trial.input_hz, [&](std::int64_t time_us) {
      while (taken < recorded.size() && recorded[taken].time_us <= time_us) ++taken;
      if (taken > sent) send(time_us, recorded[taken - 1]);
      sent = taken;
    });
  } else {
    for (const TimedPose& sample : recorded) send(sample.time_us, sample);
  }
  std::ranges::stable_sort(arrivals, {}, &Arrival::time_us);
  return arrivals;
}

void replay(const Trajectory& recorded, const ForecastTrial& trial, const ForecastModel& model,
            const VisitForecast& visit) {
  MotionPredictor predictor(model.settings);
  TimedPose newest = recorded.front();
  const std::vector<Arrival> arrivals = deliver(recorded, trial);
  const std::int64_t first_us = recorded.front().time_us + settling_us;
  const std::int64_t last_us = recorded.back().time_us - std::ranges::max(trial.horizons_us);
  auto next = arrivals.begin();
  for_each_tick(recorded, trial.asked_hz, [&](std::int64_t now_us) {
    for (; next != arrivals.end() && next->time_us <= now_us; ++next) {
      predictor.add(next->sample);
      if (next->sample.time_us > newest.time_us) newest = next->sample;
    }
    if (now_us < first_us || now_us > last_us) return;
    for (std::size_t h = 0; h < trial.horizons_us.size(); ++h) {
      const std::optional<Pose> forecast = predictor.at(now_us + trial.horizons_us[h]);
      if (forecast) visit(now_us, h, model.holds ? newest.world_from_camera : *forecast);
    }
  });
}

double forecast_error_px(const Camera& lens, const Pose& truth, const Pose& forecast) {
  Camera camera = lens;
  camera.world_from_camera = forecast;
  const auto to = math::make_camera_model(camera);
  const glm::dvec3 position(truth.position);
  const glm::dquat world_from_truth = glm::normalize(glm::dquat(truth.orientation));
  const glm::dvec2 size(lens.size_px);
  const double diagonal_px = glm::length(size);
  double sum = 0.0;
  for (const double depth : depths) {
    for (int i = 0; i < points_per_side * points_per_side; ++i) {
      const glm::dvec2 pixel = size * (glm::dvec2(i % points_per_side, i / points_per_side) + 0.5) *
                               (1.0 / points_per_side);
      const glm::dvec2 slope =
          (pixel - glm::dvec2(lens.principal_point_px)) / glm::dvec2(lens.focal_px);
      const glm::dvec3 point = position + depth * (world_from_truth * glm::dvec3(slope, 1.0));
      const auto seen = math::camera_from_world(to, {point.x, point.y, point.z});
      if (!(seen.z > 0.0)) {
        sum += diagonal_px;
        continue;
      }
      const auto image = math::image_px(to, seen);
      sum += std::min(diagonal_px, std::hypot(image.x - pixel.x, image.y - pixel.y));
    }
  }
  return sum / (points_per_side * points_per_side * depths.size());
}

double forecast_error_deg(const Pose& truth, const Pose& forecast) {
  return glm::length(rotation_between(truth.orientation, forecast.orientation)) * 180.0 /
         std::numbers::pi;
}

std::vector<ForecastErrors> judge_forecasts(const Trajectory& recorded, const ForecastTrial& trial,
                                            const Camera& lens, const ForecastModel& model) {
  std::vector<ForecastErrors> errors(trial.horizons_us.size());
  replay(recorded, trial, model,
         [&](std::int64_t now_us, std::size_t horizon, const Pose& forecast) {
           const Pose truth = interpolate(recorded, now_us + trial.horizons_us[horizon]);
           errors[horizon].px.push_back(forecast_error_px(lens, truth, forecast));
           errors[horizon].deg.push_back(forecast_error_deg(truth, forecast));
         });
  return errors;
}

}  // namespace catgs
