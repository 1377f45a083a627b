#include "server/flow/camera_forecast.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr std::int64_t frame_us = 16'667;

Pose at_x(float x) {
  Pose pose;
  pose.position.x = x;
  return pose;
}

/// Speeds up from rest as tours do: x = (t / 1 s)^2, in steps of 50 ms over one second.
PosePath accelerating() {
  PosePath path;
  for (int i = 0; i <= 20; ++i) {
    PoseSample sample;
    sample.client_time_us = i * 50'000;
    const float t = static_cast<float>(i) * 0.05f;
    sample.world_from_camera = at_x(t * t);
    path.samples.push_back(sample);
  }
  return path;
}

TEST(CameraForecast, FollowsAnAnnouncedPath) {
  CameraForecast forecast(0.2f);
  forecast.follow(accelerating());
  for (int i = 0; i < 12; ++i) {
    const float t = static_cast<float>(i * frame_us) * 1e-6f;
    forecast.add({i * frame_us, at_x(t * t)});
  }
  // From poses alone nobody sees the acceleration to come: x(0.6 s) would be 0.2.
  EXPECT_NEAR(forecast.at(600'000)->position.x, 0.36f, 1e-3f);
}

TEST(CameraForecast, LeavesThePathWithTheCamera) {
  CameraForecast forecast(0.2f), without(0.2f);
  forecast.follow(accelerating());
  for (int i = 0; i < 12; ++i) {
    const TimedPose sample{i * frame_us, at_x(-1.0f - 0.01f * static_cast<float>(i))};
    forecast.add(sample);
    without.add(sample);
  }
  EXPECT_EQ(forecast.at(250'000)->position.x, without.at(250'000)->position.x);
  EXPECT_LT(forecast.at(250'000)->position.x, -1.0f);
}

TEST(CameraForecast, AnAnnouncedPathTellsEveryFrameUntilItsEnd) {
  CameraForecast forecast(0.2f);
  forecast.follow(accelerating());
  forecast.add({0, at_x(0.0f)});
  const auto half_a_second = forecast.forecast(300'000, 20.0, 10);
  EXPECT_EQ(half_a_second->frames, 10);
  EXPECT_NEAR(half_a_second->world_from_camera.position.x, 0.64f, 1e-3f);
  const auto to_the_end = forecast.forecast(800'000, 20.0, 10);
  EXPECT_EQ(to_the_end->frames, 4);
  EXPECT_NEAR(to_the_end->world_from_camera.position.x, 1.0f, 1e-3f);
}

TEST(CameraForecast, EndsWithItsPath) {
  CameraForecast forecast(0.2f);
  forecast.follow(accelerating());
  forecast.add({900'000, at_x(0.81f)});
  EXPECT_FLOAT_EQ(forecast.at(2'000'000)->position.x, 0.81f);
  forecast.follow({});
  EXPECT_FLOAT_EQ(forecast.at(950'000)->position.x, 0.81f);
}

}  // namespace
}  // namespace catgs
