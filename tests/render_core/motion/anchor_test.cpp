#include "render_core/motion/anchor.h"

#include <gtest/gtest.h>

namespace catgs {
namespace {

glm::vec3 axis(const Pose& pose, glm::vec3 camera_axis) { return pose.orientation * camera_axis; }

TEST(Anchored, BeginsAtTheStartPoseAndKeepsGravityAndDistances) {
  SceneHints hints;
  hints.up = glm::vec3(0, 0, 1);
  hints.start_pose.position = glm::vec3(10, 20, 1.7f);
  // Looks along world x: camera z = x, camera y = -z, camera x = -y.
  hints.start_pose.orientation =
      glm::quat_cast(glm::mat3(glm::vec3(0, -1, 0), glm::vec3(0, 0, -1), glm::vec3(1, 0, 0)));

  // Recorded: y down, heading turned to the right, looking 0.3 rad upwards; then two metres ahead
  // along the heading and half a metre down.
  const glm::quat heading = glm::angleAxis(0.9f, glm::vec3(0, 1, 0));
  const glm::quat looking = heading * glm::angleAxis(0.3f, glm::vec3(1, 0, 0));
  const glm::vec3 ahead = heading * glm::vec3(0, 0, 2);
  const Trajectory moved =
      anchored({{0, {glm::vec3(-3, 1, 2), looking}},
                {10, {glm::vec3(-3, 1, 2) + ahead + glm::vec3(0, 0.5f, 0), looking}}},
               hints);
  ASSERT_EQ(moved.size(), 2u);
  EXPECT_EQ(moved[1].time_us, 10);
  EXPECT_LT(glm::length(moved[0].world_from_camera.position - glm::vec3(10, 20, 1.7f)), 1e-5f);
  EXPECT_LT(glm::length(moved[1].world_from_camera.position - glm::vec3(12, 20, 1.2f)), 1e-5f);
  const glm::vec3 view = axis(moved[0].world_from_camera, glm::vec3(0, 0, 1));
  EXPECT_NEAR(view.x, std::cos(0.3f), 1e-5f);
  EXPECT_NEAR(view.y, 0.0f, 1e-5f);
  EXPECT_NEAR(view.z, std::sin(0.3f), 1e-5f);
  const glm::vec3 right = axis(moved[0].world_from_camera, glm::vec3(1, 0, 0));
  EXPECT_NEAR(right.z, 0.0f, 1e-5f);
}

TEST(Anchored, AnEmptyTraceStaysEmpty) { EXPECT_TRUE(anchored({}, {}).empty()); }

}  // namespace
}  // namespace catgs
