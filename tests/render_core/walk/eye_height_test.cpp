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

float likeliest(const GaussianCloud& cloud, const glm::vec3& start) {
  const std::vector<float> heights = eye_heights_of(cloud, hints_at(start));
  return heights.empty() ? 0.0f : heights.front();
}

TEST(EyeHeight, FollowsTheHeightOfRooms) {
  EXPECT_NEAR(likeliest(test::room(0.9f), {2, 2, 1.2f}), 1.6f, 0.15f);
  const auto wide = test::villa();
  for (const glm::vec3& start : {test::terrace_start, glm::vec3(6, 3, 4.1f)})
    EXPECT_NEAR(likeliest(wide, start), 1.6f, 0.3f) << start.x;
}

TEST(EyeHeight, IsNotKnownOutOfDoors) {
  GaussianCloud field;
  test::add_plate(field, {0, 0, 0}, {8, 0, 0}, {0, 8, 0});
  EXPECT_EQ(eye_heights_of(field, hints_at({4, 4, 1.6f})), std::vector<float>());
  EXPECT_EQ(eye_heights_of({}, hints_at({0, 3, 1.6f})), std::vector<float>());
}

TEST(EyeHeight, TheUnitOfTheSceneDecides) {
  SceneHints hints = hints_at({2, 2, 1.2f});
  hints.about.metres_per_unit = 0.5f;
  EXPECT_EQ(eye_heights_of(test::room(0.9f), hints), std::vector<float>{3.2f});
}

}  // namespace
}  // namespace catgs::walk
