#include "render_core/motion/plain_motion.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

/// Up is -y, the camera at (1, 0, 0) looks along z, the focus is 4 units ahead.
SceneHints hints() {
  SceneHints hints;
  hints.start_pose.position = {1, 0, 0};
  hints.focus = {1, 0, 4};
  hints.limits = {glm::vec3(-100), glm::vec3(100)};
  return hints;
}

const Bounds bounds{glm::vec3(-3, -1, -2), glm::vec3(3, 1, 5)};

Trajectory make(MotionKind kind, double speed, std::optional<double> reach = std::nullopt,
                double duration_s = 20.0) {
  return make_plain_motion(
      {.kind = kind, .speed = speed, .duration_s = duration_s, .rate_hz = 100.0, .reach = reach},
      hints(), bounds);
}

glm::vec3 view_of(const Pose& pose) { return pose.orientation * glm::vec3(0, 0, 1); }

TEST(PlainMotion, PanGoesToAndFroSidewaysAtItsSpeed) {
  const Trajectory path = make(MotionKind::pan, 0.5);
  ASSERT_EQ(path.size(), 2000u);
  EXPECT_EQ(path[0].world_from_camera.position, glm::vec3(1, 0, 0));
  EXPECT_NEAR(path[100].world_from_camera.position.x, 1.5f, 1e-5f);
  float low = 1.0f, high = 1.0f;
  int turns = 0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    const glm::vec3 step =
        path[i].world_from_camera.position - path[i - 1].world_from_camera.position;
    EXPECT_EQ(step.y, 0.0f);
    EXPECT_EQ(step.z, 0.0f);
    turns += std::abs(std::abs(step.x) - 0.005f) > 1e-4f ? 1 : 0;
    EXPECT_NEAR(view_of(path[i].world_from_camera).z, 1.0f, 1e-6f);
    low = std::min(low, path[i].world_from_camera.position.x);
    high = std::max(high, path[i].world_from_camera.position.x);
  }
  EXPECT_LE(turns, 2);
  EXPECT_NEAR(high, 1.0f + 0.98f * 2.0f, 0.006f);
  EXPECT_NEAR(low, 1.0f - 0.98f * 4.0f, 0.006f);
}

TEST(PlainMotion, ZoomGoesAlongTheView) {
  const Trajectory path = make(MotionKind::zoom, 1.0, std::nullopt, 4.0);
  EXPECT_NEAR(path[300].world_from_camera.position.z, 3.0f, 1e-5f);
  EXPECT_NEAR(path[300].world_from_camera.position.x, 1.0f, 1e-6f);
}

TEST(PlainMotion, AReachIsKept) {
  for (const TimedPose& pose : make(MotionKind::zoom, 1.0, 0.25)) {
    EXPECT_LE(std::abs(pose.world_from_camera.position.z), 0.25f + 1e-6f);
  }
}

TEST(PlainMotion, RotateTurnsOnTheSpot) {
  const Trajectory path = make(MotionKind::rotate, std::numbers::pi / 2);
  EXPECT_NEAR(view_of(path[100].world_from_camera).x, 1.0f, 1e-5f);   // to the right
  EXPECT_NEAR(view_of(path[200].world_from_camera).z, -1.0f, 1e-5f);  // and all around
  for (const TimedPose& pose : path) {
    EXPECT_EQ(pose.world_from_camera.position, glm::vec3(1, 0, 0));
    EXPECT_NEAR((pose.world_from_camera.orientation * glm::vec3(0, 1, 0)).y, 1.0f, 1e-5f);
  }
}

TEST(PlainMotion, OrbitLooksAtTheFocus) {
  for (const TimedPose& pose : make(MotionKind::orbit, 1.0)) {
    const glm::vec3 arm = hints().focus - pose.world_from_camera.position;
    EXPECT_NEAR(glm::length(arm), 4.0f, 1e-4f);
    EXPECT_NEAR(glm::dot(view_of(pose.world_from_camera), arm), 4.0f, 1e-3f);
  }
}

TEST(PlainMotion, RefusesWhatItCannotDo) {
  EXPECT_THROW(make(MotionKind::pan, 0.0), InputError);
  EXPECT_THROW(make(MotionKind::pan, std::numeric_limits<double>::infinity()), InputError);
  EXPECT_THROW(make(MotionKind::pan, 1.0, -1.0), InputError);
  EXPECT_THROW(make(MotionKind::pan, 1.0, 1.0, 0.0), InputError);
  SceneHints outside = hints();
  outside.start_pose.position = {0, 50, 0};
  EXPECT_THROW(make_plain_motion({.kind = MotionKind::pan}, outside, bounds), InputError);
  EXPECT_NO_THROW(make_plain_motion({.kind = MotionKind::pan, .reach = 1.0}, outside, bounds));
  EXPECT_NO_THROW(make_plain_motion({.kind = MotionKind::rotate}, outside, bounds));
}

}  // namespace
}  // namespace catgs
