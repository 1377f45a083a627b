#include "render_core/motion/script.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/metrics/summary.h"
#include "render_core/motion/portable.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

constexpr double degrees = 180.0 / std::numbers::pi;

SceneHints room() {
  SceneHints hints;
  hints.limits = {glm::vec3(-4, -3, -5), glm::vec3(4, 0, 5)};
  hints.start_pose.position = glm::vec3(0.5f, -1.6f, -2.0f);
  hints.focus = glm::vec3(0, -1, 0);
  return hints;
}

ScriptOptions script(const std::string& name, std::uint64_t seed = 1, double duration_s = 20.0) {
  return {.script = name, .seed = seed, .duration_s = duration_s, .rate_hz = 120.0};
}

glm::vec3 view_axis(const Pose& pose) { return pose.orientation * glm::vec3(0, 0, 1); }

double angle_deg(const Pose& a, const Pose& b) {
  const glm::dquat turn = glm::conjugate(glm::dquat(a.orientation)) * glm::dquat(b.orientation);
  return 2.0 * degrees *
         std::atan2(glm::length(glm::dvec3(turn.x, turn.y, turn.z)), std::abs(turn.w));
}

std::vector<double> angular_speeds_deg_s(const Trajectory& trajectory) {
  std::vector<double> speeds;
  for (std::size_t i = 3; i < trajectory.size(); i += 3) {  // spans of 25 ms, as in the recordings
    const double span_s =
        static_cast<double>(trajectory[i].time_us - trajectory[i - 3].time_us) * 1e-6;
    speeds.push_back(
        angle_deg(trajectory[i - 3].world_from_camera, trajectory[i].world_from_camera) / span_s);
  }
  std::sort(speeds.begin(), speeds.end());
  return speeds;
}

std::vector<double> speeds_per_s(const Trajectory& trajectory) {
  std::vector<double> speeds;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const double span_s =
        static_cast<double>(trajectory[i].time_us - trajectory[i - 1].time_us) * 1e-6;
    speeds.push_back(glm::length(trajectory[i].world_from_camera.position -
                                 trajectory[i - 1].world_from_camera.position) /
                     span_s);
  }
  std::sort(speeds.begin(), speeds.end());
  return speeds;
}

class EveryScript : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Script, EveryScript,
                         ::testing::Values("orbit", "walk", "head", "drone", "still"),
                         [](const auto& name) { return name.param; });

TEST_P(EveryScript, StartsAtTheStartPoseAtTimeZeroAndKeepsTheRate) {
  const SceneHints hints = room();
  const Trajectory trajectory = make_script(script(GetParam()), hints);
  ASSERT_EQ(trajectory.size(), 2400u);
  EXPECT_EQ(trajectory[0].time_us, 0);
  EXPECT_EQ(trajectory[1].time_us, 8'333);
  EXPECT_EQ(trajectory[2399].time_us, 19'991'667);
  const glm::vec3 start = trajectory[0].world_from_camera.position;
  EXPECT_LT(glm::length(start - hints.start_pose.position), 0.2f);
}

TEST_P(EveryScript, StaysInsideTheLimitsOfAnyScene) {
  for (const float size : {0.01f, 1.0f, 300.0f}) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      SceneHints hints = room();
      hints.limits.min *= size;
      hints.limits.max *= size;
      hints.focus *= size;
      hints.start_pose.position *= seed % 2 == 0 ? size : 3.0f * size;  // odd: starts outside
      for (const TimedPose& pose : make_script(script(GetParam(), seed, 60.0), hints)) {
        const glm::vec3 position = pose.world_from_camera.position;
        ASSERT_TRUE(glm::all(glm::lessThanEqual(hints.limits.min, position)) &&
                    glm::all(glm::lessThanEqual(position, hints.limits.max)))
            << GetParam() << " seed " << seed << " at " << pose.time_us << " us: " << position.x
            << ' ' << position.y << ' ' << position.z;
        ASSERT_NEAR(glm::length(pose.world_from_camera.orientation), 1.0f, 1e-5f);
      }
    }
  }
}

TEST_P(EveryScript, MovesSmoothly) {
  const Trajectory trajectory = make_script(script(GetParam(), 5, 60.0), room());
  for (std::size_t i = 2; i < trajectory.size(); ++i) {
    const glm::vec3 a = trajectory[i - 2].world_from_camera.position;
    const glm::vec3 b = trajectory[i - 1].world_from_camera.position;
    const glm::vec3 c = trajectory[i].world_from_camera.position;
    // At 120 Hz a change of speed of 0.25 m/s between frames would be 30 m/s^2: nobody moves so.
    ASSERT_LT(glm::length((c - b) - (b - a)) * 120.0f, 0.25f) << i;
    ASSERT_LT(angle_deg(trajectory[i - 1].world_from_camera, trajectory[i].world_from_camera), 3.0)
        << i;
  }
}

TEST_P(EveryScript, DependsOnTheSeedOnly) {
  const auto same = [](const Trajectory& a, const Trajectory& b) {
    return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](auto& x, auto& y) {
             return std::memcmp(&x.world_from_camera, &y.world_from_camera, sizeof(Pose)) == 0;
           });
  };
  const Trajectory first = make_script(script(GetParam(), 7), room());
  EXPECT_TRUE(same(first, make_script(script(GetParam(), 7), room())));
  const bool seed_matters = GetParam() != "still";
  EXPECT_EQ(same(first, make_script(script(GetParam(), 8), room())), !seed_matters);
}

TEST_P(EveryScript, SurvivesAFlatSceneAndAnyAxes) {
  SceneHints hints = room();
  hints.limits = {glm::vec3(2), glm::vec3(2)};
  hints.up = glm::vec3(0, 0, 1);
  hints.start_pose.position = hints.focus = glm::vec3(2);
  for (const TimedPose& pose : make_script(script(GetParam()), hints)) {  // looks straight up
    ASSERT_EQ(pose.world_from_camera.position, glm::vec3(2));
    ASSERT_NEAR(glm::length(pose.world_from_camera.orientation), 1.0f, 1e-5f);
  }
}

/// FNV-1a over the bits of all poses: the promise "the same on every machine".
std::uint64_t fingerprint(const Trajectory& trajectory) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const TimedPose& pose : trajectory) {
    const Pose& p = pose.world_from_camera;
    for (const float value : {p.position.x, p.position.y, p.position.z, p.orientation.x,
                              p.orientation.y, p.orientation.z, p.orientation.w}) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      hash = (hash ^ bits) * 0x100000001b3u;
    }
  }
  return hash;
}

TEST(Script, IsTheSameOnEveryMachine) {
  EXPECT_EQ(fingerprint(make_script(script("orbit", 3), room())), 3087765152671622422u);
  EXPECT_EQ(fingerprint(make_script(script("walk", 3), room())), 1954973801552005251u);
  EXPECT_EQ(fingerprint(make_script(script("head", 3), room())), 17913188494063944469u);
  EXPECT_EQ(fingerprint(make_script(script("drone", 3), room())), 6544683687530955303u);
}

TEST(Script, HeadHasTheStatisticsOfRecordedHeadMotion) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Trajectory trajectory = make_script(script("head", seed, 60.0), room());
    const std::vector<double> turning = angular_speeds_deg_s(trajectory);
    const std::vector<double> moving = speeds_per_s(trajectory);
    SCOPED_TRACE(seed);
    EXPECT_GT(percentile(turning, 0.10), 5.0);  // fixations sway ...
    EXPECT_LT(percentile(turning, 0.10), 16.0);
    EXPECT_GT(percentile(turning, 0.50), 20.0);
    EXPECT_LT(percentile(turning, 0.50), 40.0);
    EXPECT_GT(percentile(turning, 0.90), 50.0);
    EXPECT_LT(percentile(turning, 0.90), 110.0);
    EXPECT_GT(percentile(turning, 0.99), 90.0);  // ... and turns are quick
    EXPECT_LT(percentile(turning, 0.99), 200.0);
    EXPECT_GT(percentile(moving, 0.50), 0.08);
    EXPECT_LT(percentile(moving, 0.50), 0.5);
    EXPECT_LT(percentile(moving, 0.99), 1.5);
  }
}

TEST(Script, OrbitLooksAtTheFocusFromAConstantHeight) {
  const SceneHints hints = room();
  for (const TimedPose& pose : make_script(script("orbit"), hints)) {
    const glm::vec3 to_focus = glm::normalize(hints.focus - pose.world_from_camera.position);
    ASSERT_GT(glm::dot(view_axis(pose.world_from_camera), to_focus), 0.99999f);
    ASSERT_NEAR(pose.world_from_camera.position.y, -1.6f, 1e-4f);
  }
}

TEST(Script, WalkKeepsEyeHeightAndLevelImage) {
  const Trajectory trajectory = make_script(script("walk", 2, 60.0), room());
  for (const TimedPose& pose : trajectory) {
    ASSERT_NEAR(pose.world_from_camera.position.y, -1.6f, 0.03f);
    const glm::vec3 right = pose.world_from_camera.orientation * glm::vec3(1, 0, 0);
    ASSERT_NEAR(right.y, 0.0f, 1e-5f);
  }
  const double median = percentile(speeds_per_s(trajectory), 0.5);
  EXPECT_GT(median, 0.9);
  EXPECT_LT(median, 1.4);
}

TEST(Script, DroneBanksIntoItsTurns) {
  const Trajectory trajectory = make_script(script("drone", 2, 60.0), room());
  int banked = 0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const Pose& before = trajectory[i - 1].world_from_camera;
    const Pose& now = trajectory[i].world_from_camera;
    const glm::vec3 right = now.orientation * glm::vec3(1, 0, 0);
    const float turn = glm::dot(view_axis(now) - view_axis(before), right) * 120.0f;  // rad/s
    if (std::abs(turn) < 0.2f) continue;
    // y points down: the right wing goes down in a right turn.
    banked += right.y * turn > 0.0f ? 1 : -1;
  }
  EXPECT_GT(banked, 1000);
}

class Tour : public ::testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "tour.tum";
};

TEST_F(Tour, PassesItsKeyframesSmoothlyAndStaysAtTheLast) {
  const glm::vec3 up(0, 1, 0);
  write_tum(path_, {{5'000'000, {glm::vec3(0, -1, 0), glm::angleAxis(0.0f, up)}},
                    {7'000'000, {glm::vec3(1, -1, 2), glm::angleAxis(1.0f, up)}},
                    {8'000'000, {glm::vec3(2, -2, 1), glm::angleAxis(1.5f, up)}}});
  ScriptOptions options = script("tour:" + path_.string(), 1, 5.0);
  options.rate_hz = 100.0;
  const Trajectory trajectory = make_script(options, room());
  ASSERT_EQ(trajectory.size(), 500u);
  EXPECT_LT(glm::length(trajectory[0].world_from_camera.position - glm::vec3(0, -1, 0)), 1e-5f);
  EXPECT_LT(glm::length(trajectory[200].world_from_camera.position - glm::vec3(1, -1, 2)), 1e-5f);
  EXPECT_LT(glm::length(trajectory[499].world_from_camera.position - glm::vec3(2, -2, 1)), 1e-5f);
  EXPECT_GT(glm::dot(trajectory[200].world_from_camera.orientation, glm::angleAxis(1.0f, up)),
            0.99999f);
  EXPECT_LT(speeds_per_s(trajectory).back(), 4.0);
}

TEST_F(Tour, StaysInsideTheLimits) {
  const glm::quat still(1, 0, 0, 0);
  write_tum(path_, {{0, {glm::vec3(0, -1, 0), still}}, {1'000'000, {glm::vec3(90, -1, 2), still}}});
  for (const TimedPose& pose : make_script(script("tour:" + path_.string(), 1, 2.0), room())) {
    ASSERT_LE(pose.world_from_camera.position.x, 4.0f);
  }
}

TEST(Script, RefusesWhatItDoesNotKnow) {
  const auto refused = [](const ScriptOptions& options) {
    return test::refusal_of([&] { make_script(options, room()); }).source;
  };
  EXPECT_EQ(refused(script("jump")), "--script");
  EXPECT_EQ(refused(script("tour:/nonexistent.tum")), "/nonexistent.tum");
  EXPECT_EQ(refused(script("head", 1, 0.0)), "--duration");
  ScriptOptions options = script("head");
  options.rate_hz = std::nan("");
  EXPECT_EQ(refused(options), "--fps");
}

TEST(Portable, SineAndCosineAreAccurate) {
  for (double angle = -1e6; angle < 1e6; angle += 137.0731) {
    EXPECT_NEAR(portable_sincos(angle).sin, std::sin(angle), 1e-15);
    EXPECT_NEAR(portable_sincos(angle).cos, std::cos(angle), 1e-15);
  }
}

}  // namespace
}  // namespace catgs
