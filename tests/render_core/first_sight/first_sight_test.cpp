#include "render_core/first_sight/first_sight.h"

#include <cmath>
#include <limits>
#include <memory>
#include <random>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "render_core/scene/analysis/enclosure.h"
#include "render_core/scene/analysis/up_axis.h"
#include "render_core/scene/analysis/voxel_grid.h"
#include "render_core/scene/copy_gaussians.h"
#include "render_core/scene/files/sanitize.h"
#include "tests/render_core/scene/random_cloud.h"
#include "tests/support/interiors.h"
#include "tests/support/surface_clouds.h"

namespace catgs::test {
namespace {

constexpr glm::vec3 up_y(0, -1, 0), up_z(0, 0, 1);

glm::vec3 forward(const Pose& pose) { return pose.orientation * glm::vec3(0, 0, 1); }
glm::vec3 up(const Pose& pose) { return pose.orientation * glm::vec3(0, -1, 0); }

SceneHints estimate(const GaussianCloud& cloud, const glm::vec3& up_axis = up_y) {
  return estimate_hints(cloud, up_axis, std::make_shared<ThreadPool>(2));
}

/// The half extent of what a picture of 16:9, 60 degrees high, shows of `p`, 1 at the border.
float off_centre(const SceneHints& hints, const glm::vec3& p) {
  const Pose& pose = hints.start_pose;
  const glm::vec3 c = camera_from_world_rotation(pose) * (p - pose.position);
  constexpr float half_height = 0.57735f, half_width = half_height * 16.0f / 9.0f;
  if (c.z <= 0.0f) return std::numeric_limits<float>::infinity();
  return std::max(std::abs(c.x) / (half_width * c.z), std::abs(c.y) / (half_height * c.z));
}

TEST(FirstSight, ObjectsAreSeenWholeFromTheUsualFront) {
  for (const float radius : {0.01f, 1.0f, 300.0f}) {
    const GaussianCloud cloud = ball(radius);
    const SceneHints hints = estimate(cloud);
    for (const glm::vec3& mean : cloud.mean) ASSERT_LT(off_centre(hints, mean), 1.0f);
    EXPECT_LT(glm::length(hints.start_pose.position), 5.0f * radius);
    EXPECT_LT(hints.start_pose.position.z, 0.0f) << "not from the usual front";
    EXPECT_LT(glm::length(hints.focus), 0.5f * radius);
    EXPECT_LT(hints.near_z, 0.1f * radius);
    EXPECT_LT(up(hints.start_pose).y, -0.5f);
    EXPECT_EQ(hints.source, "estimated");
  }
}

/// A ball whose one side is a chessboard has its face there.
TEST(FirstSight, TheSideWithMostDetailIsTheFront) {
  GaussianCloud cloud = ball(1.0f);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const glm::vec3& p = cloud.mean[i];
    const bool is_white = (std::lround(6.0f * p.y) + std::lround(6.0f * p.z)) % 2 == 0;
    if (p.x > 0.5f) cloud.sh[i] = glm::vec3(is_white ? 1.5f : -1.5f);
  }
  EXPECT_GT(estimate(cloud).start_pose.position.x, 1.0f);
}

/// A statue on wide ground, high above the bounds of most Gaussians.
TEST(FirstSight, TallThingsAreInThePicture) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1.0f, 1.0f);
  std::size_t i = 0;
  const GaussianCloud cloud = sampled_surface(50000, 0.02f, [&] {
    const glm::vec3 p(uniform(random), uniform(random), uniform(random));
    return i++ % 25 == 0 ? glm::vec3(0.1f * p.x, -0.5f + 0.5f * p.y, 0.1f * p.z)
                         : glm::vec3(2.0f * p.x, 0.02f * p.y, 2.0f * p.z);
  });
  EXPECT_LT(off_centre(estimate(cloud), {0.0f, -1.0f, 0.0f}), 1.0f);
}

TEST(FirstSight, RoomsAreSeenFromInside) {
  const glm::vec3 eye = glm::abs(estimate(room()).start_pose.position);
  EXPECT_LT(eye.x, 4.0f);
  EXPECT_LT(eye.y, 1.5f);
  EXPECT_LT(eye.z, 3.0f);
}

TEST(FirstSight, AHallIsSeenFromInsideAlongItsLengthDespiteFloatersAroundIt) {
  const Pose start = estimate(hall(100000)).start_pose;
  EXPECT_LT(std::abs(start.position.x), 19.5f);
  EXPECT_LT(std::abs(start.position.z), 6.0f);
  EXPECT_LT(start.position.y, -0.5f) << "in the floor";
  EXPECT_GT(start.position.y, -7.5f) << "in the roof";
  EXPECT_GT(std::abs(forward(start).x), 0.8f);
  EXPECT_LT(std::abs(forward(start).y), 0.3f);
}

TEST(FirstSight, AFlatWithZUpIsSeenFromOneOfItsRooms) {
  const Pose start = estimate(flat(100000), up_z).start_pose;
  EXPECT_GT(start.position.z, 0.4f);
  EXPECT_LT(start.position.z, 2.2f);
  EXPECT_GT(start.position.x, 0.0f);
  EXPECT_LT(start.position.x, 12.0f);
  EXPECT_LT(std::abs(forward(start).z), 0.3f) << "a plan view";
  EXPECT_GT(up(start).z, 0.9f);
}

TEST(FirstSight, TheCameraNeverStandsInsideOfACluster) {
  // A fog ball around the middle and a wall of it on every place but one side.
  GaussianCloud cloud = ball(1.0f);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-3.0f, 3.0f);
  GaussianCloud fog = sampled_surface(60000, 0.1f, [&] {
    return glm::vec3(uniform(random), uniform(random), std::abs(uniform(random)));
  });
  for (float& opacity : fog.opacity) opacity = 0.1f;
  const std::size_t first = cloud.size();
  cloud.resize(first + fog.size(), 0);
  copy_gaussians(fog, first, cloud);
  const SceneHints hints = estimate(cloud);
  const VoxelGrid grid(cloud, hints.limits);
  EXPECT_LT(grid.depth_around(hints.start_pose.position), 0.2f);
}

TEST(FirstSight, AnyUpIsKept) {
  const GaussianCloud cloud = ball(1.0f);
  for (const glm::vec3& axis : {glm::vec3(0, 0, 1), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)})
    EXPECT_GT(glm::dot(up(estimate(cloud, axis).start_pose), axis), 0.5f);
}

// Two exporters write the same capture with half a turn about x between them.
TEST(FirstSight, AHalfTurnedSceneIsSeenTheSame) {
  const glm::quat half(0, 1, 0, 0);
  for (const GaussianCloud& cloud : {hall(100000), flat(100000)}) {
    GaussianCloud turned = cloud;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      turned.mean[i] = half * cloud.mean[i];
      turned.rotation[i] = half * cloud.rotation[i];
    }
    const SceneHints one = estimate(cloud, find_up(cloud, {}));
    const SceneHints other = estimate(turned, find_up(turned, {}));
    EXPECT_LT(glm::distance(half * one.start_pose.position, other.start_pose.position), 1e-3f);
    EXPECT_LT(glm::distance(half * forward(one.start_pose), forward(other.start_pose)), 1e-3f);
    EXPECT_LT(glm::distance(half * up(one.start_pose), up(other.start_pose)), 1e-3f);
  }
}

TEST(FirstSight, RepeatsItselfWithAnyNumberOfThreads) {
  const GaussianCloud cloud = flat(50000);
  const Pose one = estimate_hints(cloud, up_z, std::make_shared<ThreadPool>(1)).start_pose;
  const Pose three = estimate_hints(cloud, up_z, std::make_shared<ThreadPool>(3)).start_pose;
  EXPECT_EQ(one.position, three.position);
  EXPECT_EQ(one.orientation, three.orientation);
}

TEST(FirstSight, DegenerateCloudsGetAUsablePose) {
  for (const GaussianCloud& cloud : {random_cloud(1, 0), GaussianCloud{}}) {
    const SceneHints hints = estimate(cloud);
    EXPECT_TRUE(std::isfinite(glm::length(hints.start_pose.position)));
    EXPECT_NEAR(glm::length(hints.start_pose.orientation), 1.0f, 1e-5f);
    EXPECT_GT(hints.near_z, 0.0f);
    EXPECT_LT(hints.limits.min.x, hints.limits.max.x);
  }
}

/// Small clouds of what sanitize() keeps: as far away as coordinates go, so that some axes have no
/// extent, and with scales of any size.
TEST(FirstSight, AnyCloudHasAView) {
  ThreadPool pool(2);
  std::mt19937 random(3);
  const auto number = [&](float low, float high) {  // between powers of ten, of either sign
    const float size = std::pow(10.0f, std::uniform_real_distribution(low, high)(random));
    return random() % 2 == 0 ? size : -size;
  };
  for (int k = 0; k < 8; ++k) {
    GaussianCloud cloud = random_cloud(1 + random() % 9, 0, static_cast<unsigned>(k));
    const glm::vec3 far(number(-2, 9), number(-2, 9), number(-2, 9));
    const float extent = std::abs(number(-9, 2));
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      cloud.mean[i] = extent * cloud.mean[i] + (k % 2 == 0 ? far : glm::vec3(0, far.y, 0));
      cloud.scale[i] *= extent * std::abs(number(-3, 3));
      if (k % 4 == 0) cloud.mean[i] *= std::abs(number(-9, 0));
    }
    sanitize(cloud, LoadContext(pool));
    if (cloud.empty()) continue;
    const SceneHints hints = estimate(cloud, find_up(cloud, {}));
    const glm::vec3 point = hints.start_pose.position;
    EXPECT_TRUE(std::isfinite(point.x + point.y + point.z)) << k;
    EXPECT_NEAR(glm::length(hints.start_pose.orientation), 1.0f, 1e-3f) << k;
    EXPECT_GT(hints.near_z, 0.0f) << k;
    EXPECT_GT(hints.scale, 0.0f) << k;
  }
}

TEST(FirstSight, RoomsEncloseTheStartAndObjectsDoNot) {
  ThreadPool pool(2);
  const auto is_enclosed = [&](const GaussianCloud& cloud, SceneHints hints) {
    return is_start_enclosed(SurfacePoints(cloud, pool), hints);
  };
  EXPECT_TRUE(is_enclosed(hall(100000), estimate(hall(100000))));
  EXPECT_TRUE(is_enclosed(flat(100000), estimate(flat(100000), up_z)));
  EXPECT_FALSE(is_enclosed(ball(1.0f), estimate(ball(1.0f))));
  EXPECT_FALSE(is_enclosed({}, SceneHints{}));
  // The author leads visitors around a thing in the middle of the hall.
  SceneHints hints = estimate(hall(100000));
  hints.focus = {0.0f, -1.6f, 0.0f};
  hints.start_pose.position = {1.5f, -1.6f, 0.0f};
  EXPECT_FALSE(is_enclosed(hall(100000), hints));
}

/// Rays of a thin layer 10^9 units away, where no step of a cell's size changes a coordinate.
TEST(FirstSight, RaysEndWhereStepsAreLostInRounding) {
  GaussianCloud cloud = random_cloud(200, 0);
  for (glm::vec3& mean : cloud.mean) mean = {1e-7f * mean.x, 1e9f, 1e-7f * mean.z};
  for (glm::vec3& scale : cloud.scale) scale = glm::vec3(1e-10f);
  for (float& opacity : cloud.opacity) opacity = 0.004f;
  const SceneHints hints = estimate(cloud);
  EXPECT_GT(hints.near_z, 0.0f);
}

}  // namespace
}  // namespace catgs::test
