#include "render_core/motion/predictor.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/metrics/summary.h"
#include "render_core/motion/script.h"

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

MotionPredictor fed(const std::vector<std::int64_t>& times_us) {
  MotionPredictor predictor;
  for (const std::int64_t time_us : times_us) predictor.add(on_path(time_us));
  return predictor;
}

TEST(Predictor, KnowsNothingAtFirst) {
  MotionPredictor predictor;
  EXPECT_FALSE(predictor.at(0).has_value());
  EXPECT_FALSE(predictor.forecast(0, 120.0, 4).has_value());
  predictor.add(on_path(1'000));
  expect_near(predictor.at(50'000), on_path(1'000).world_from_camera);
  EXPECT_FALSE(predictor.forecast(1'000, 120.0, 4).has_value());
}

TEST(Predictor, ContinuesAConstantMotion) {
  const MotionPredictor predictor = fed({0, 8'000, 16'000, 24'000, 32'000, 40'000});
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

TEST(Predictor, NeedsTwoSamplesHoweverSlowTheyCome) {
  expect_near(fed({0, 200'000}).at(250'000), on_path(250'000).world_from_camera);
}

TEST(Predictor, IgnoresTheSignOfQuaternions) {
  MotionPredictor predictor;
  for (int i = 0; i < 6; ++i) {
    TimedPose sample = on_path(i * 8'000);
    if (i % 2 == 1) sample.world_from_camera.orientation *= -1.0f;
    predictor.add(sample);
  }
  expect_near(predictor.at(60'000), on_path(60'000).world_from_camera);
}

TEST(Predictor, ASampleWithAKnownStampReplacesThatSample) {
  MotionPredictor predictor = fed({0, 10'000, 20'000});
  TimedPose wrong = on_path(30'000);
  wrong.world_from_camera.position.x += 0.02f;
  predictor.add(wrong);
  predictor.add(on_path(30'000));
  predictor.add(on_path(30'000));
  expect_near(predictor.at(60'000), on_path(60'000).world_from_camera);
}

TEST(Predictor, LateSamplesAreOrdered) {
  expect_near(fed({0, 20'000, 10'000, 40'000, 30'000}).at(60'000),
              on_path(60'000).world_from_camera);
  // Older than all that is known of this motion: it adds nothing.
  MotionPredictor predictor = fed({1'000'000, 1'010'000, 1'020'000});
  TimedPose stale = on_path(900'000);
  stale.world_from_camera.position.y = 7.0f;
  predictor.add(stale);
  expect_near(predictor.at(1'060'000), on_path(1'060'000).world_from_camera);
}

TEST(Predictor, AGapOrASetClockBeginsANewMotion) {
  for (const std::int64_t jump_us : {400'000, -5'000'000}) {
    MotionPredictor predictor = fed({1'000'000, 1'010'000, 1'020'000});
    const TimedPose after = on_path(1'020'000 + jump_us);
    predictor.add(after);
    EXPECT_FALSE(predictor.forecast(after.time_us, 120.0, 4).has_value());
    expect_near(predictor.at(after.time_us + 30'000), after.world_from_camera);
    predictor.add(on_path(after.time_us + 10'000));
    expect_near(predictor.at(after.time_us + 30'000),
                on_path(after.time_us + 30'000).world_from_camera);
  }
}

TEST(Predictor, ForgetsInSilence) {
  const MotionPredictor predictor = fed({0, 10'000, 20'000});
  EXPECT_TRUE(predictor.forecast(270'000, 120.0, 4).has_value());
  EXPECT_FALSE(predictor.forecast(270'001, 120.0, 4).has_value());
}

TEST(Predictor, StopsAtTheHorizon) {
  const MotionPredictor predictor = fed({0, 10'000, 20'000});
  expect_near(predictor.at(120'000), on_path(120'000).world_from_camera);
  expect_near(predictor.at(900'000), on_path(120'000).world_from_camera);
}

TEST(Predictor, ATeleportIsNotAVelocity) {
  MotionPredictor predictor = fed({0, 10'000, 20'000, 30'000, 40'000});
  const auto elsewhere = [](std::int64_t time_us) {
    TimedPose sample = on_path(time_us);
    sample.world_from_camera.position.z += 5.0f;
    return sample;
  };
  predictor.add(elsewhere(50'000));
  EXPECT_FALSE(predictor.forecast(50'000, 120.0, 4).has_value());
  expect_near(predictor.at(80'000), elsewhere(50'000).world_from_camera);
  predictor.add(elsewhere(60'000));
  expect_near(predictor.at(80'000), elsewhere(80'000).world_from_camera);
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
}

TEST(Predictor, AStillCameraStaysStill) {
  MotionPredictor predictor;
  const Pose pose = on_path(123'456).world_from_camera;
  for (int i = 0; i < 20; ++i) predictor.add({i * frame_us, pose});
  const auto forecast = predictor.forecast(19 * frame_us, 120.0, 4);
  ASSERT_TRUE(forecast.has_value());
  EXPECT_EQ(forecast->world_from_camera.position, pose.position);
  EXPECT_FLOAT_EQ(std::abs(glm::dot(forecast->world_from_camera.orientation, pose.orientation)),
                  1.0f);
  // It starts: the second sample in motion shows the whole velocity, not a fifth of it.
  for (int i = 1; i < 3; ++i) {
    predictor.add(
        {(19 + i) * frame_us,
         {pose.position + glm::vec3(0.01f * static_cast<float>(i), 0, 0), pose.orientation}});
  }
  const auto start = predictor.at(22 * frame_us);
  ASSERT_TRUE(start.has_value());
  EXPECT_NEAR(start->position.x, pose.position.x + 0.03f, 1e-4f);
}

TEST(Predictor, IgnoresWhatIsNoPose) {
  MotionPredictor predictor = fed({0, 10'000, 20'000});
  predictor.add({30'000, {{std::nanf(""), 0, 0}, {1, 0, 0, 0}}});
  predictor.add({30'000, {{0, 0, 0}, {0, 0, 0, 0}}});
  predictor.add({30'000, {{0, 0, 0}, {std::numeric_limits<float>::infinity(), 0, 0, 0}}});
  expect_near(predictor.at(60'000), on_path(60'000).world_from_camera);
}

TEST(Predictor, KeepsABoundedHistory) {
  MotionPredictor predictor;
  for (int i = 0; i < 100'000; ++i) predictor.add(on_path(i));  // 1 MHz
  expect_near(predictor.at(130'000), on_path(130'000).world_from_camera);
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
  const char* shared = std::getenv("CATGS_SHARED_DIR");
  const std::filesystem::path traces =
      (shared != nullptr ? std::filesystem::path(shared)
                         : std::filesystem::path(CATGS_SOURCE_DIR).parent_path() / "shared") /
      "traces";
  if (!std::filesystem::is_directory(traces)) GTEST_SKIP() << traces << " is not there";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(traces)) {
    if (entry.path().extension() != ".tum") continue;
    const Errors errors = median_errors(read_tum(entry.path()));
    EXPECT_LT(errors.predicted, 0.5 * errors.still) << entry.path();
  }
}

}  // namespace
}  // namespace catgs
