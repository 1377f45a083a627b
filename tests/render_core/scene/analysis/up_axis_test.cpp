#include "render_core/scene/analysis/up_axis.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/trigonometric.hpp>
#include <gtest/gtest.h>

#include "render_core/math/axis_name.h"
#include "render_core/math/look_at.h"
#include "render_core/synth/synth.h"
#include "tests/support/interiors.h"
#include "tests/support/surface_clouds.h"

namespace catgs::test {
namespace {

constexpr glm::vec3 minus_y(0, -1, 0), plus_z(0, 0, 1);

float degrees_between(const glm::vec3& a, const glm::vec3& b) {
  return glm::degrees(std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)));
}

void turn(GaussianCloud& cloud, const glm::quat& by) {
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean[i] = by * cloud.mean[i];
    cloud.rotation[i] = by * cloud.rotation[i];
  }
}

/// Level cameras on an arc of 90 degrees that look at the origin and down.
std::vector<Pose> arc(float down_deg) {
  std::vector<Pose> poses;
  for (int i = 0; i <= 10; ++i) {
    const float azimuth = glm::radians(9.0f * static_cast<float>(i));
    const float height = std::tan(glm::radians(down_deg));
    poses.push_back(
        look_at({std::sin(azimuth), -height, -std::cos(azimuth)}, glm::vec3(0), minus_y));
  }
  return poses;
}

TEST(UpAxis, LookAtKeepsUpUprightInTheImage) {
  const glm::vec3 eye(3, -2, 5), target(0, 0, 1);
  const Pose pose = look_at(eye, target, minus_y);
  EXPECT_LT(degrees_between(pose.orientation * glm::vec3(0, 0, 1), target - eye), 0.01f);
  const glm::vec3 in_image = camera_from_world_rotation(pose) * minus_y;
  EXPECT_NEAR(in_image.x, 0.0f, 1e-5f);
  EXPECT_LT(in_image.y, 0.0f);  // image y points down
}

TEST(UpAxis, LookAtAcceptsDegenerateDirections) {
  for (const glm::vec3& target : {glm::vec3(0, -5, 0), glm::vec3(0, 5, 0), glm::vec3(0)}) {
    const Pose pose = look_at(glm::vec3(0), target, minus_y);
    EXPECT_NEAR(glm::length(pose.orientation), 1.0f, 1e-5f);
    if (target == glm::vec3(0)) continue;
    EXPECT_LT(degrees_between(pose.orientation * glm::vec3(0, 0, 1), target), 0.01f);
  }
}

const glm::quat as_it_is(1, 0, 0, 0), half_about_x(0, 1, 0, 0), half_about_z(0, 0, 0, 1);

struct Known {
  const char* name;
  GaussianCloud cloud;
  glm::vec3 up;
};

TEST(UpAxis, FloorsTellUp) {
  EXPECT_LT(degrees_between(find_up(hall(50000), {}), minus_y), 0.5f);
  EXPECT_LT(degrees_between(find_up(flat(50000), {}), plus_z), 0.5f);
}

// Rooms have floor and ceiling alike, so the rest of the content tells.
TEST(UpAxis, AHalfTurnOfTheSceneTurnsUpOver) {
  const std::vector<Known> scenes = {
      {"hall", hall(50000), minus_y},
      {"flat", flat(50000), plus_z},
      {"city", synthesize(SynthKind::city, 100'000, 1).cloud, minus_y},
      {"garden", synthesize(SynthKind::garden, 100'000, 1).cloud, minus_y}};
  for (const auto& [name, cloud, up] : scenes)
    for (const glm::quat& half : {half_about_x, half_about_z}) {
      GaussianCloud turned = cloud;
      turn(turned, half);
      if (up == plus_z && half == half_about_z) continue;  // it stands as before
      EXPECT_LT(degrees_between(find_up(turned, {}), half * up), 0.5f) << name;
    }
}

// Where files of a kind have y up or down alike, faint light from above decides.
TEST(UpAxis, FaintEvidenceDecidesWhereYMayBeUpOrDown) {
  GaussianCloud cloud = ball(1.0f);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const auto noise = static_cast<float>(std::fmod(0.618034 * static_cast<double>(i), 1.0));
    cloud.sh[i * cloud.sh_count()] = glm::vec3(2.0f * noise - 1.0f - 0.2f * cloud.mean[i].y);
  }
  for (const glm::quat& by : {as_it_is, half_about_x}) {
    GaussianCloud turned = cloud;
    turn(turned, by);
    EXPECT_EQ(find_up(turned, {}), minus_y);
    EXPECT_LT(degrees_between(find_up(turned, {}, 1.0f, UsualUp::either_y), by * minus_y), 0.5f);
  }
}

/// Every `stride`-th Gaussian, in the order along an axis; 3: in that of the cloud.
GaussianCloud part_of(const GaussianCloud& cloud, int axis, std::size_t stride) {
  std::vector<std::size_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0);
  if (axis < 3)
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return cloud.mean[i][axis]; });
  GaussianCloud part;
  part.resize(cloud.size() / stride, 0);
  for (std::size_t k = 0; k < part.size(); ++k) {
    const std::size_t i = order[k * stride];
    part.mean[k] = cloud.mean[i];
    part.rotation[k] = cloud.rotation[i];
    part.scale[k] = cloud.scale[i];
    part.opacity[k] = cloud.opacity[i];
    part.sh[k] = cloud.sh_of(i)[0];
  }
  return part;
}

TEST(UpAxis, NeitherOrderNorSampleChangesIt) {
  const glm::quat y_up = glm::angleAxis(glm::radians(90.0f), glm::vec3(1, 0, 0));
  const std::vector<Known> scenes = {{"hall", hall(80000), minus_y}, {"flat", flat(80000), plus_z}};
  for (const auto& [name, cloud, up] : scenes)
    for (const glm::quat& by : {as_it_is, half_about_x, y_up, glm::conjugate(y_up),
                                glm::angleAxis(glm::radians(35.0f), up)})
      for (int axis = 0; axis <= 3; ++axis)
        for (const std::size_t stride : {1, 2, 7, 16}) {
          GaussianCloud part = part_of(cloud, axis, stride);
          turn(part, by);
          const glm::vec3 found = find_up(part, {}, static_cast<float>(stride));
          EXPECT_LT(degrees_between(found, by * up), 1.0f) << name << " " << axis << " " << stride;
        }
}

TEST(UpAxis, AHallThatWasCapturedAskewIsLevelled) {
  GaussianCloud cloud = hall(50000);
  const glm::quat askew = glm::angleAxis(glm::radians(14.0f), glm::normalize(glm::vec3(1, 0, 2)));
  turn(cloud, askew);
  EXPECT_LT(degrees_between(find_up(cloud, {}), askew * minus_y), 0.5f);
}

TEST(UpAxis, CamerasThatLookDownDoNotTiltTheHorizon) {
  for (const float down_deg : {0.0f, 9.0f, 40.0f})
    EXPECT_LT(degrees_between(find_up(ball(1.0f), arc(down_deg)), minus_y), 0.5f) << down_deg;
}

TEST(UpAxis, OneCameraGivesItsOwnUp) {
  const std::vector<Pose> one = {look_at({0, 0, -3}, glm::vec3(0), glm::vec3(0, -1, 0))};
  EXPECT_LT(degrees_between(find_up(ball(1.0f), one), minus_y), 0.5f);
}

TEST(UpAxis, CamerasThatLookStraightDownLeaveItToTheFloor) {
  std::vector<Pose> drone;
  for (int i = 0; i < 36; ++i) {
    const glm::quat spin = glm::angleAxis(glm::radians(10.0f * static_cast<float>(i)), plus_z);
    const glm::quat down = glm::angleAxis(glm::radians(180.0f), glm::vec3(1, 0, 0));
    drone.push_back({{6, 4, 10}, spin * down});
  }
  EXPECT_LT(degrees_between(find_up(flat(50000), drone), plus_z), 0.5f);
}

TEST(UpAxis, AxesHaveNames) {
  EXPECT_EQ(axis_named("-y"), minus_y);
  EXPECT_EQ(axis_named("+z"), plus_z);
  EXPECT_EQ(axis_named("x"), glm::vec3(1, 0, 0));
  for (const char* text : {"", "+", "-w", "zz", "+-z", "xyz"})
    EXPECT_FALSE(axis_named(text)) << text;
}

TEST(UpAxis, AThingWithoutAFloorHasTheUsualUp) {
  EXPECT_EQ(find_up(ball(1.0f), {}), minus_y);
  EXPECT_EQ(find_up(GaussianCloud{}, {}), minus_y);
  EXPECT_EQ(find_up(ball(1.0f), {}, 1.0f, UsualUp::plus_z), plus_z);
}

}  // namespace
}  // namespace catgs::test
