// What `catgs-render trace forecast` is made of: that it shows a forecaster the past alone, and
// that it measures what it says.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/motion/script.h"
#include "render_core/tools/trace/forecast_trial.h"
#include "tests/render_core/tools/run_catgs_render.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using ::testing::HasSubstr;

const Camera lens = make_camera({}, {1920, 1080}, 1100.0f);

/// Two seconds of a person looking around, at 72 Hz.
Trajectory looking_around() {
  SceneHints hints;
  hints.limits = {glm::vec3(-10), glm::vec3(10)};
  hints.focus = {0, 0, 3};
  return make_script({.script = "head", .duration_s = 2.0, .rate_hz = 72.0}, hints);
}

/// Sideways and about the vertical axis at constant rates.
Trajectory gliding() {
  Trajectory path;
  for (int i = 0; i < 144; ++i) {
    const float seconds = static_cast<float>(i) / 72.0f;
    path.push_back({std::llround(1e6 * i / 72.0),
                    {{0.5f * seconds, 0, 0}, glm::angleAxis(seconds, glm::vec3(0, 1, 0))}});
  }
  return path;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Whether samples come as taken, or at the rate of a client.
class Forecasts : public ::testing::TestWithParam<double> {
 protected:
  ForecastTrial trial_{.input_hz = GetParam()};
};

TEST_P(Forecasts, NoSampleComesEarlyOrTwice) {
  const Trajectory recorded = looking_around();
  const double interval_us = GetParam() > 0.0 ? 1e6 / GetParam() : 0.0;
  std::map<std::int64_t, int> times_sent;
  std::int64_t last_us = 0;
  for (const Arrival& arrival : deliver(recorded, trial_)) {
    EXPECT_GE(arrival.time_us, last_us);
    last_us = arrival.time_us;
    const auto late_us = static_cast<double>(arrival.time_us - arrival.sample.time_us);
    EXPECT_GE(late_us, 0.0);
    EXPECT_LE(late_us, 20'000.0 + interval_us);
    EXPECT_EQ(++times_sent[arrival.sample.time_us], 1);
  }
  const double expected_hz = GetParam() > 0.0 ? std::min(GetParam(), 72.0) : 72.0;
  EXPECT_NEAR(static_cast<double>(times_sent.size()), 2.0 * expected_hz, 2.0);
}

// Not a bit of a forecast may depend on what is measured after it was made.
TEST_P(Forecasts, KnowOnlyThePast) {
  const Trajectory recorded = looking_around();
  constexpr std::int64_t now_us = 1'200'000;
  Trajectory other = recorded;
  for (TimedPose& sample : other) {
    if (sample.time_us <= now_us) continue;
    sample.world_from_camera.position += glm::vec3(1.0f);
    sample.world_from_camera.orientation = glm::quat(0, 1, 0, 0);
  }
  using Known = std::vector<std::tuple<std::int64_t, std::size_t, glm::vec3, glm::quat>>;
  for (const ForecastModel& model : forecast_models()) {
    const auto until_now = [&](const Trajectory& path) {
      Known known;
      std::size_t later = 0;
      replay(path, trial_, model, [&](std::int64_t time_us, std::size_t h, const Pose& p) {
        if (time_us <= now_us) known.emplace_back(time_us, h, p.position, p.orientation);
        later += time_us > now_us ? 1 : 0;
      });
      EXPECT_GT(later, 100u);
      return known;
    };
    const Known known = until_now(recorded);
    EXPECT_GT(known.size(), 300u) << model.name;
    EXPECT_TRUE(known == until_now(other)) << model.name;
  }
}

TEST_P(Forecasts, OfAConstantMotionComeTrue) {
  for (const ForecastModel& model : forecast_models()) {
    SCOPED_TRACE(model.name);
    const auto errors = judge_forecasts(gliding(), trial_, lens, model);
    ASSERT_EQ(errors.size(), 5u);
    for (const ForecastErrors& at_horizon : errors) EXPECT_GT(at_horizon.px.size(), 150u);
    const double px = mean(errors[4].px), deg = mean(errors[4].deg);  // at 100 ms
    if (model.name == "Held") {
      // At 57.3 degrees a second; the newest sample is some 10 to 30 ms old.
      EXPECT_GT(deg, 0.11 * 57.3);
      EXPECT_LT(deg, 0.13 * 57.3);
    } else {
      EXPECT_LT(px, 1.0);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Inputs, Forecasts, ::testing::Values(0.0, 60.0, 120.0));

TEST(ForecastError, IsThatOfPointsAtThreeDepths) {
  const Pose truth{{1, 2, 3}, glm::angleAxis(0.3f, glm::vec3(0, 1, 0))};
  EXPECT_NEAR(forecast_error_px(lens, truth, truth), 0.0, 1e-9);
  EXPECT_EQ(forecast_error_deg(truth, truth), 0.0);

  Pose beside = truth;  // 1 cm to the right
  beside.position += truth.orientation * glm::vec3(0.01f, 0, 0);
  EXPECT_NEAR(forecast_error_px(lens, truth, beside), 11.0 * (1.0 + 1.0 / 3 + 0.1) / 3, 1e-3);

  Pose rolled = truth;  // a point moves by the angle times its distance from the middle
  rolled.orientation = truth.orientation * glm::angleAxis(0.001f, glm::vec3(0, 0, 1));
  double distances = 0.0;
  for (const double x : {240.0, 720.0}) {
    for (const double y : {135.0, 405.0}) distances += std::hypot(x, y);
  }
  EXPECT_NEAR(forecast_error_px(lens, truth, rolled), 0.001 * distances / 4, 1e-3);
  EXPECT_NEAR(forecast_error_deg(truth, rolled), 0.0573, 1e-4);

  Pose back = truth;
  back.orientation = truth.orientation * glm::quat(0, 0, 1, 0);
  EXPECT_NEAR(forecast_error_px(lens, truth, back), std::hypot(1920.0, 1080.0), 1e-6);
}

class TraceForecast : public ::testing::Test {
 protected:
  test::TemporaryFolder folder_;
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
};

TEST_F(TraceForecast, PrintsATablePerInput) {
  write_tum(folder_ / "glide.tum", gliding());
  const auto outcome =
      test::run("--quiet trace forecast --trace " + path("glide.tum") + " " + path("glide.tum") +
                " --input native,30 --json " + path("tables.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("**Native samples: error in pixels**"));
  EXPECT_THAT(outcome.out, HasSubstr("| MotionPredictor | 0."));
  std::ifstream file(path("tables.json"));
  const auto json = nlohmann::json::parse(file);
  ASSERT_EQ(json.at("tables").size(), 4u);
  EXPECT_EQ(json.at("tables").at(3).at("title"), "30 Hz: error in degrees");
  const auto& rows = json.at("tables").at(2).at("rows");
  EXPECT_EQ(rows.size(), forecast_models().size());
  EXPECT_GT(rows.at("Held").at("p95 at 100 ms"), rows.at("MotionPredictor").at("p95 at 100 ms"));
}

TEST_F(TraceForecast, NamesMistakes) {
  write_tum(folder_ / "glide.tum", gliding());
  Trajectory brief = gliding();
  brief.resize(60);
  write_tum(folder_ / "brief.tum", brief);
  const auto expect = [&](const std::string& arguments, const std::string& message) {
    const auto outcome = test::run("trace forecast --trace " + arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.out, HasSubstr(message));
  };
  expect(path("brief.tum"), "brief.tum: is shorter than a second");
  expect(path("none.tum"), "none.tum: cannot be opened");
  expect(path("glide.tum") + " --input 60,often", "--input: \"often\" is not a rate");
  expect(path("glide.tum") + " --size 12", "--size: \"12\" is not a picture size");
}

// The reason why MotionPredictor is what it is.
TEST(SharedTraces, MotionPredictorForeseesHeadsAsWellAsAny) {
  const char* shared = std::getenv("CATGS_SHARED_DIR");
  const std::filesystem::path traces =
      (shared != nullptr ? std::filesystem::path(shared)
                         : std::filesystem::path(CATGS_SOURCE_DIR).parent_path() / "shared") /
      "traces/head";
  if (!std::filesystem::is_directory(traces)) GTEST_SKIP() << traces << " is not there";
  ForecastTrial trial;
  trial.asked_hz = 10.0;
  std::map<std::string, std::vector<double>> sums;  // per horizon
  for (const auto& entry : std::filesystem::directory_iterator(traces)) {
    if (entry.path().extension() != ".tum") continue;
    const Trajectory recorded = read_tum(entry.path());
    for (const ForecastModel& model : forecast_models()) {
      const auto errors = judge_forecasts(recorded, trial, lens, model);
      auto& sum = sums[model.name];
      sum.resize(errors.size());
      for (std::size_t h = 0; h < errors.size(); ++h) sum[h] += mean(errors[h].px);
    }
  }
  const std::vector<double>& ours = sums.at("MotionPredictor");
  for (const auto& [name, theirs] : sums) {
    for (std::size_t h = 0; h < ours.size(); ++h) EXPECT_LE(ours[h], 1.01 * theirs[h]) << name << h;
  }
}

}  // namespace
}  // namespace catgs
