#include "render_core/motion/predictor.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/metrics/summary.h"
#include "render_core/motion/script.h"
#include "tests/support/shared_folder.h"

namespace catgs {
namespace {

constexpr std::int64_t frame_us = 8'333;

/// Constant motion: 2 units a second along x, half a turn a second around y.
TimedPose on_path(std::int64_t time_us) {
  const float seconds = static_cast<float>(time_us) * 1e-6f;
  return {time_us,
          {{2.0f * seconds, 1.0f, 0.0f}, glm::angleAxis(3.1415927f * seconds, glm::vec3(0, 1, 0))}};
}

float angle_between(const Pose& a, const Pose& b) {
  return 2.0f * std::acos(std::min(1.0f, std::abs(glm::dot(a.orientation, b.orientation))));
}

void expect_near(const std::optional<Pose>& pose, const Pose& expected) {
  ASSERT_TRUE(pose.has_value());
  EXPECT_NEAR(glm::distance(pose->position, expected.position), 0.0f, 1e-4f);
  EXPECT_NEAR(angle_between(*pose, expected), 0.0f, 2e-3f);  // acos near 1 has no more digits
}

MotionPredictor fed(const std::vector<std::int64_t>& times_us, std::int64_t last_warm_up_us = -1) {
  MotionPredictor predictor;
  // Long enough for forecasts to have come true.
  for (std::int64_t time_us = last_warm_up_us - 400'000; time_us <= last_warm_up_us;
       time_us += 10'000) {
    predictor.add(on_path(time_us));
  }
  for (const std::int64_t time_us : times_us) predictor.add(on_path(time_us));
  return predictor;
}

/// A camera that stands still, for 200 ms up to time 0.
MotionPredictor at_rest(const Pose& pose) {
  MotionPredictor predictor;
  for (std::int64_t time_us = -200'000; time_us <= 0; time_us += 10'000) {
    predictor.add({time_us, pose});
  }
  return predictor;
}

TEST(Predictor, KnowsNothingAtFirst) {
  MotionPredictor predictor;
  EXPECT_FALSE(predictor.at(0).has_value());
  EXPECT_FALSE(predictor.forecast(0, 120.0, 4).has_value());
  // A step may be a teleport; two that agree are a motion.
  for (const std::int64_t time_us : {1'000, 9'000}) {
    predictor.add(on_path(time_us));
    expect_near(predictor.at(50'000), on_path(time_us).world_from_camera);
    EXPECT_FALSE(predictor.forecast(time_us, 120.0, 4).has_value());
  }
  predictor.add(on_path(17'000));
  EXPECT_TRUE(predictor.forecast(17'000, 120.0, 4).has_value());
  EXPECT_GT(predictor.at(50'000)->position.x, on_path(45'000).world_from_camera.position.x);
}

TEST(Predictor, ContinuesAConstantMotion) {
  const MotionPredictor predictor = fed({0, 8'000, 16'000, 24'000, 32'000, 40'000});
  EXPECT_GT(predictor.confidence(), 0.99);
  expect_near(predictor.at(40'000), on_path(40'000).world_from_camera);
  expect_near(predictor.at(73'000), on_path(73'000).world_from_camera);
  const auto forecast = predictor.forecast(40'000, 100.0, 5);
  ASSERT_TRUE(forecast.has_value());
  EXPECT_EQ(forecast->frames, 5);
  expect_near(forecast->world_from_camera, on_path(90'000).world_from_camera);
}

TEST(Predictor, TakesIrregularStamps) {
  const MotionPredictor predictor = fed({0, 3'000, 21'000, 22'000, 22'001, 55'000, 70'000});
  expect_near(predictor.at(100'000), on_path(100'000).world_from_camera);
}

TEST(Predictor, KnowsAMotionHoweverSlowSamplesCome) {
  MotionPredictor predictor;
  for (int i = 0; i < 8; ++i) predictor.add(on_path(i * 200'000));
  expect_near(predictor.at(1'450'000), on_path(1'450'000).world_from_camera);
}

TEST(Predictor, IgnoresTheSignOfQuaternions) {
  MotionPredictor predictor;
  for (int i = 0; i < 40; ++i) {
    TimedPose sample = on_path(i * 8'000);
    if (i % 2 == 1) sample.world_from_camera.orientation *= -1.0f;
    predictor.add(sample);
  }
  expect_near(predictor.at(340'000), on_path(340'000).world_from_camera);
}

TEST(Predictor, ASampleWithAKnownStampReplacesThatSample) {
  MotionPredictor predictor = fed({0, 10'000, 20'000});
  TimedPose wrong = on_path(30'000);
  wrong.world_from_camera.position.x += 0.02f;
  predictor.add(wrong);
  predictor.add(on_path(30'000));
  predictor.add(on_path(30'000));
  EXPECT_NEAR(predictor.at(60'000)->position.x, on_path(60'000).world_from_camera.position.x,
              1e-3f);  // that the forecast was checked with the wrong one remains
}

TEST(Predictor, LateSamplesAreOrdered) {
  expect_near(fed({0, 20'000, 10'000, 40'000, 30'000}).at(60'000),
              on_path(60'000).world_from_camera);
  // Older than all that is known of this motion: it adds nothing.
  MotionPredictor predictor;
  for (const std::int64_t time_us : {1'000'000, 1'010'000, 1'020'000}) {
    predictor.add(on_path(time_us));
  }
  const Pose before = *predictor.at(1'060'000);
  TimedPose stale = on_path(900'000);
  stale.world_from_camera.position.y = 7.0f;
  predictor.add(stale);
  EXPECT_EQ(predictor.at(1'060'000)->position, before.position);
}

TEST(Predictor, ALateSampleCorrectsTheVelocity) {
  // A turn of the path that only the late sample shows.
  const auto corner = [](std::int64_t time_us) {
    const float x = 1e-6f * static_cast<float>(time_us);
    return TimedPose{time_us, {{x, std::max(0.0f, x - 0.2f), 0}, {1, 0, 0, 0}}};
  };
  const auto motion = [&](std::vector<std::int64_t> times_us) {
    MotionPredictor predictor;
    for (std::int64_t time_us = 0; time_us <= 200'000; time_us += 20'000) {
      predictor.add(corner(time_us));
    }
    for (const std::int64_t time_us : times_us) predictor.add(corner(time_us));
    return predictor.at(300'000)->position.y;
  };
  const float in_order = motion({220'000, 240'000});
  EXPECT_NEAR(motion({240'000, 220'000}), in_order, 1e-3f);
  EXPECT_GT(std::abs(motion({240'000}) - in_order), 3e-3f);
}

TEST(Predictor, AGapOrASetClockBeginsANewMotion) {
  for (const std::int64_t jump_us : {400'000, -5'000'000}) {
    MotionPredictor predictor = fed({1'000'000, 1'010'000, 1'020'000}, 990'000);
    const TimedPose after = on_path(1'020'000 + jump_us);
    predictor.add(after);
    EXPECT_FALSE(predictor.forecast(after.time_us, 120.0, 4).has_value());
    expect_near(predictor.at(after.time_us + 30'000), after.world_from_camera);
    for (int i = 1; i < 40; ++i) predictor.add(on_path(after.time_us + i * 10'000));
    expect_near(predictor.at(after.time_us + 420'000),
                on_path(after.time_us + 420'000).world_from_camera);
  }
}

TEST(Predictor, ForgetsInSilence) {
  const MotionPredictor predictor = fed({0, 10'000, 20'000});
  EXPECT_TRUE(predictor.forecast(270'000, 120.0, 4).has_value());
  EXPECT_FALSE(predictor.forecast(270'001, 120.0, 4).has_value());
}

TEST(Predictor, PromisesNoFrameBehindTheHorizon) {
  const MotionPredictor predictor = fed({0, 10'000, 20'000});
  struct Case {
    std::int64_t age_us;
    double rate_hz;
    int asked, held;
  };
  for (const Case& c : {Case{0, 120.0, 16, 12}, Case{0, 60.0, 4, 4}, Case{0, 40.0, 4, 4},
                        Case{0, 30.0, 4, 3}, Case{0, 9.0, 4, 0}, Case{50'000, 30.0, 4, 3},
                        Case{100'000, 30.0, 4, 1}, Case{200'000, 30.0, 4, 0}}) {
    const std::int64_t now_us = 20'000 + c.age_us;
    const auto forecast = predictor.forecast(now_us, c.rate_hz, c.asked);
    ASSERT_TRUE(forecast.has_value());
    EXPECT_EQ(forecast->frames, c.held) << c.rate_hz << " Hz, " << c.age_us << " us";
    // The motion keeps its speed up to the last promised frame.
    if (c.held == 0) continue;
    const auto end_us = now_us + static_cast<std::int64_t>(c.held * 1e6 / c.rate_hz);
    expect_near(forecast->world_from_camera, on_path(end_us).world_from_camera);
  }
}

TEST(Predictor, StopsBehindTheHorizon) {
  const MotionPredictor predictor = fed({0, 10'000, 20'000});
  expect_near(predictor.at(170'000), on_path(170'000).world_from_camera);
  expect_near(predictor.at(900'000), on_path(170'000).world_from_camera);
}

TimedPose elsewhere(std::int64_t time_us) {
  TimedPose sample = on_path(time_us);
  sample.world_from_camera.position.z += 5.0f;
  return sample;
}

TEST(Predictor, ATeleportIsNotAVelocity) {
  MotionPredictor predictor = fed({0, 10'000, 20'000, 30'000, 40'000});
  for (const std::int64_t time_us : {50'000, 60'000}) {
    predictor.add(elsewhere(time_us));
    EXPECT_FALSE(predictor.forecast(time_us, 120.0, 4).has_value());
    expect_near(predictor.at(time_us + 30'000), elsewhere(time_us).world_from_camera);
  }
  for (std::int64_t time_us = 70'000; time_us < 500'000; time_us += 10'000) {
    predictor.add(elsewhere(time_us));
    EXPECT_EQ(predictor.at(time_us + 30'000)->position.z, 5.0f);
  }
  expect_near(predictor.at(530'000), elsewhere(530'000).world_from_camera);
}

TEST(Predictor, ATeleportAtTheStartIsNotAVelocity) {
  MotionPredictor predictor;
  predictor.add(on_path(0));
  for (std::int64_t time_us = 10'000; time_us < 100'000; time_us += 10'000) {
    predictor.add(elsewhere(time_us));
    EXPECT_EQ(predictor.at(time_us + 30'000)->position.z, 5.0f);
    EXPECT_EQ(predictor.forecast(time_us, 120.0, 4).has_value(), time_us >= 30'000) << time_us;
  }
}

TEST(Predictor, ATurnOnTheSpotIsAJumpToo) {
  MotionPredictor predictor;
  for (int i = 0; i < 5; ++i) {
    predictor.add(
        {i * 10'000, {{}, glm::angleAxis(0.001f * static_cast<float>(i), glm::vec3(0, 1, 0))}});
  }
  predictor.add({50'000, {{}, glm::angleAxis(1.5f, glm::vec3(0, 1, 0))}});
  EXPECT_FALSE(predictor.forecast(50'000, 120.0, 4).has_value());
}

TEST(Predictor, StampsInABurstMakeNoJump) {
  // Steps of 8 ms whose stamps came 0.1 ms apart.
  MotionPredictor predictor = fed({0, 8'000, 16'000, 24'000});
  TimedPose burst = on_path(32'000);
  burst.time_us = 24'100;
  predictor.add(burst);
  EXPECT_TRUE(predictor.forecast(24'100, 120.0, 4).has_value());
  // It has come far; that it did so in 0.1 ms would mean 5 units more.
  EXPECT_NEAR(predictor.at(54'100)->position.x, 2.0f * 0.062f, 0.05f);
}

TEST(Predictor, AStillCameraStaysStill) {
  const Pose pose = on_path(123'456).world_from_camera;
  MotionPredictor predictor = at_rest(pose);
  EXPECT_TRUE(predictor.still());
  const auto forecast = predictor.forecast(0, 120.0, 16);
  ASSERT_TRUE(forecast.has_value());
  EXPECT_EQ(forecast->frames, 12);  // the whole horizon
  EXPECT_EQ(forecast->world_from_camera.position, pose.position);
  EXPECT_FLOAT_EQ(std::abs(glm::dot(forecast->world_from_camera.orientation, pose.orientation)),
                  1.0f);
  // It starts. The third sample in motion shows the whole velocity: those at rest say nothing.
  for (int i = 1; i <= 3; ++i) {
    predictor.add(
        {i * frame_us,
         {pose.position + glm::vec3(0.05f * static_cast<float>(i), 0, 0), pose.orientation}});
  }
  EXPECT_FALSE(predictor.still());
  EXPECT_NEAR(predictor.at(4 * frame_us)->position.x, pose.position.x + 0.2f, 2e-3f);
}

TEST(Predictor, TremorIsNoMotion) {
  MotionPredictor predictor = at_rest({});
  for (int i = 1; i < 60; ++i) {
    predictor.add({i * frame_us,
                   {{i % 2 == 0 ? 2e-4f : 0.0f, 0, i % 3 == 0 ? 3e-4f : 0.0f},
                    glm::angleAxis(i % 5 == 0 ? 1e-4f : 0.0f, glm::vec3(1, 0, 0))}});
    EXPECT_TRUE(predictor.still());
    const auto forecast = predictor.forecast(i * frame_us, 120.0, 4);
    ASSERT_TRUE(forecast.has_value());
    EXPECT_EQ(forecast->frames, 4);
    EXPECT_LT(glm::length(forecast->world_from_camera.position), 5e-4f);
  }
}

TEST(Predictor, TheTremorThresholdDependsOnTheScene) {
  EXPECT_DOUBLE_EQ(forecast_lever(0.2f), 15.0 * static_cast<double>(0.2f));
  EXPECT_EQ(forecast_lever(0.0f), PredictorSettings{}.lever);
  for (const float near_z : {0.2f, 0.002f}) {
    MotionPredictor predictor({.lever = forecast_lever(near_z)});
    for (int i = 0; i < 60; ++i) {  // 5 mm a second in metres, 50 cm in a hundredth of that
      predictor.add({i * 10'000, {{5e-5f * static_cast<float>(i), 0, 0}, {1, 0, 0, 0}}});
    }
    EXPECT_EQ(predictor.still(), near_z == 0.2f);
  }
}

TEST(Predictor, ASlowMotionIsNotStill) {
  MotionPredictor predictor;  // 1 unit / minute
  const auto creeping = [](std::int64_t time_us) {
    return TimedPose{time_us, {{static_cast<float>(time_us) * 1e-6f / 60.0f, 0, 0}, {1, 0, 0, 0}}};
  };
  for (int i = 0; i < 100; ++i) predictor.add(creeping(i * frame_us));
  EXPECT_FALSE(predictor.still());
  expect_near(predictor.at(900'000), creeping(900'000).world_from_camera);
}

TimedPose swaying(std::int64_t time_us, double amplitude_rad, double rate_hz) {
  const double angle = amplitude_rad * std::sin(2.0 * std::numbers::pi * rate_hz * 1e-6 *
                                                static_cast<double>(time_us));
  return {time_us, {{}, glm::angleAxis(static_cast<float>(angle), glm::vec3(0, 1, 0))}};
}

// The error of going on at the velocity of a sinusoid is at most its largest acceleration times
// t^2 / 2; smoothing lags by about an interval of samples more.
TEST(Predictor, ASinusoidIsForeseenWithinItsCurvature) {
  constexpr double amplitude = 0.3, rate_hz = 1.0;
  MotionPredictor predictor;
  for (int i = 0; i < 360; ++i) {
    predictor.add(swaying(i * frame_us, amplitude, rate_hz));
    if (i < 60) continue;
    for (const std::int64_t ahead_us : {8'000, 33'000, 66'000}) {
      const std::int64_t then_us = i * frame_us + ahead_us;
      const double acceleration = amplitude * std::pow(2.0 * std::numbers::pi * rate_hz, 2.0);
      const double lag = 1e-6 * static_cast<double>(ahead_us + 2 * frame_us);
      EXPECT_LE(angle_between(*predictor.at(then_us),
                              swaying(then_us, amplitude, rate_hz).world_from_camera),
                0.5 * acceleration * lag * lag + 1e-3);
    }
  }
}

TEST(Predictor, TrustsForecastsThatComeTrue) {
  // To and fro faster than forecasts can follow, and slower.
  const auto after = [](double rate_hz) {
    MotionPredictor predictor;
    for (int i = 0; i < 120; ++i) predictor.add(swaying(i * frame_us, 0.05, rate_hz));
    return predictor;
  };
  const MotionPredictor slow = after(0.5), quick = after(5.0), erratic = after(15.0);
  EXPECT_GT(slow.confidence(), 0.9);
  EXPECT_LT(quick.confidence(), 0.6);
  EXPECT_EQ(erratic.confidence(), 0.0);
  const auto window = [](const MotionPredictor& predictor) {
    return predictor.forecast(119 * frame_us, 120.0, 12)->frames;
  };
  EXPECT_EQ(window(slow), 12);
  EXPECT_LT(window(quick), 12);
  EXPECT_EQ(window(erratic), 6);
}

TEST(Predictor, CanBeToldToTrustWhatever) {
  MotionPredictor predictor({.horizon_us = 200'000, .min_confidence = 1.0});
  for (int i = 0; i < 120; ++i) predictor.add(swaying(i * frame_us, 0.05, 15.0));
  EXPECT_EQ(predictor.forecast(119 * frame_us, 120.0, 16)->frames, 16);
}

TEST(Predictor, IgnoresWhatIsNoPose) {
  MotionPredictor predictor = fed({0, 10'000, 20'000});
  predictor.add({30'000, {{std::nanf(""), 0, 0}, {1, 0, 0, 0}}});
  predictor.add({30'000, {{0, 0, 0}, {0, 0, 0, 0}}});
  predictor.add({30'000, {{0, 0, 0}, {std::numeric_limits<float>::infinity(), 0, 0, 0}}});
  expect_near(predictor.at(60'000), on_path(60'000).world_from_camera);
}

TEST(Predictor, TakesAMillionSamplesASecond) {
  MotionPredictor predictor;
  for (int i = 0; i < 400'000; ++i) predictor.add(on_path(i));
  expect_near(predictor.at(430'000), on_path(430'000).world_from_camera);
}

/// Median errors in pixels (1920x1080, f = 1100 px, depth 2) of the poses 33 ms after each sample
/// of a path: predicted, and when the camera is taken to stay where it is.
struct Errors {
  double predicted = 0.0, still = 0.0;
};
Errors median_errors(const Trajectory& path) {
  std::vector<double> predicted, still;
  MotionPredictor predictor;
  for (const TimedPose& sample : path) {
    predictor.add(sample);
    const std::int64_t later_us = sample.time_us + 33'000;
    if (later_us > path.back().time_us) break;
    const Camera truth = make_camera(interpolate(path, later_us), {1920, 1080}, 1100.0f);
    predicted.push_back(max_displacement_px(truth, *predictor.at(later_us), 2.0f));
    still.push_back(max_displacement_px(truth, sample.world_from_camera, 2.0f));
  }
  return {summarize(predicted).p50, summarize(still).p50};
}

TEST(Predictor, ForeseesScriptedMotion) {
  SceneHints hints;
  hints.limits = {glm::vec3(-10), glm::vec3(10)};
  hints.focus = {0, 0, 3};
  struct Case {
    const char* script;
    double share;  // of the error of a camera that is taken to stay
  };
  for (const Case& c :
       {Case{"orbit", 0.1}, Case{"walk", 0.3}, Case{"head", 0.5}, Case{"drone", 0.2}}) {
    const Errors errors = median_errors(make_script({.script = c.script}, hints));
    EXPECT_LT(errors.predicted, c.share * errors.still) << c.script;
  }
}

TEST(SharedTraces, RecordedMotionIsForeseen) {
  const auto traces = test::shared_folder("traces");
  if (traces.empty()) GTEST_SKIP() << "no shared folder traces";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(traces)) {
    if (entry.path().extension() != ".tum") continue;
    const Errors errors = median_errors(read_tum(entry.path()));
    EXPECT_LT(errors.predicted, 0.5 * errors.still) << entry.path();
  }
}

}  // namespace
}  // namespace catgs
