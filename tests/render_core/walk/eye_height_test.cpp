#include "render_core/walk/eye_height.h"

#include <gtest/gtest.h>

#include "tests/render_core/walk/worlds.h"

namespace catgs::walk {
namespace {

SceneHints hints_at(const glm::vec3& start) {
  SceneHints hints;
  hints.up = {0, 0, 1};
  hints.start_pose.position = start;
  return hints;
}

TEST(EyeHeight, FollowsTheHeightOfARoom) {
  const auto height = estimate_eye_height(test::room(0.9f), hints_at({2, 2, 1.2f}));
  ASSERT_TRUE(height);
  EXPECT_NEAR(*height, 1.6f, 0.15f);
}

TEST(EyeHeight, IsNotKnownOutOfDoors) {
  EXPECT_FALSE(estimate_eye_height(test::stairs(), hints_at({0, 3, 1.6f})));
  EXPECT_FALSE(estimate_eye_height({}, hints_at({0, 3, 1.6f})));
}

}  // namespace
}  // namespace catgs::walk
