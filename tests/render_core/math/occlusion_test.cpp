// Limits of depth from the last picture's ends, against what they mean, in double.

#include <cmath>
#include <limits>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <gtest/gtest.h>

#include "render_core/math/occlusion-inl.h"
#include "tests/support/random_source.h"

namespace catgs {
namespace {

constexpr double unknown = std::numeric_limits<double>::infinity();
constexpr glm::ivec2 size_px{320, 192};

math::CameraModel<double> model_of(const Pose& pose) {
  return math::make_camera_model(make_camera(pose, size_px, 183.0f));
}

/// The ray of a pixel in the world, one unit along the view axis.
glm::dvec3 ray_of(const Pose& pose, const glm::dvec2& pixel) {
  return glm::dquat(pose.orientation) *
         glm::dvec3((pixel - 0.5 * glm::dvec2(size_px)) / 183.0, 1.0);
}

/// A small step and turn.
Pose near_to(const Pose& pose, test::RandomSource& random) {
  return {pose.position + glm::vec3(0.2 * random.direction()),
          pose.orientation * glm::quat(glm::angleAxis(0.05, random.direction()))};
}

// The last camera saw a plane. Its view depth at a pixel is where the pixel's ray meets the plane,
// by vectors of the world. The limit must be there too, seen from the new camera.
TEST(OcclusionLimit, IsTheSurfaceThatTheLastPictureEndedAt) {
  test::RandomSource random(7);
  int known = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Pose last{glm::vec3(3.0 * random.direction()),
                    glm::quat(glm::angleAxis(random.uniform(0.0, 3.0), random.direction()))};
    const Pose now = near_to(last, random);
    // At right angles to the last axis, so that one step finds it.
    const glm::dvec3 normal = glm::dquat(last.orientation) * glm::dvec3(0, 0, 1);
    const double depth = random.uniform(2.0, 20.0);
    const auto end = [&](double x, double y) {
      const bool inside = x >= 0 && y >= 0 && x < size_px.x && y < size_px.y;
      return inside ? depth : unknown;
    };
    const glm::dvec2 pixel(random.uniform(0.0, 320.0), random.uniform(0.0, 192.0));
    const double limit =
        math::occlusion_limit<double>(model_of(now), model_of(last), {pixel.x, pixel.y}, end);
    const glm::dvec3 offset = glm::dvec3(last.position) + depth * normal - glm::dvec3(now.position);
    const double wall = glm::dot(offset, normal) / glm::dot(ray_of(now, pixel), normal);
    if (std::isinf(limit)) continue;
    ++known;
    EXPECT_NEAR(limit, (1.0 + occlusion_margin) * wall, 1e-4 * wall);
  }
  EXPECT_GT(known, 200);
}

TEST(OcclusionLimit, TakesTheDeepestEndOnTheWay) {
  // Left of the middle everything ends at 2, right of it at 8. The ray through (170, 96) of a
  // camera half a unit to the right meets depth 2 left of the middle's right side, and depth 8
  // nearer to it.
  const auto end = [](double x, double) { return x < 200.0 ? 2.0 : 8.0; };
  const Pose now{{0.5f, 0, 0}, {1, 0, 0, 0}};
  // From infinity: x = 170, end 2. At depth 2: x = 170 + 183 / 2 * 0.5 = 215.75, end 8.
  const double limit = math::occlusion_limit<double>(model_of(now), model_of({}), {170, 96}, end);
  EXPECT_NEAR(limit, 8.0 * (1.0 + occlusion_margin), 1e-4);
}

TEST(OcclusionLimit, IsUnknownWhereTheLastPictureShowsNothing) {
  const auto even = [](double, double) { return 5.0; };
  const auto nothing = [](double, double) { return unknown; };
  const auto limit = [&](const Pose& now, const auto& end) {
    return math::occlusion_limit<double>(model_of(now), model_of({}), {100, 60}, end);
  };
  EXPECT_LT(limit({}, even), unknown);
  EXPECT_EQ(limit({}, nothing), unknown);
  EXPECT_EQ(limit({{0, 0, 0}, {0, 0, 1, 0}}, even), unknown) << "looks back";
  EXPECT_EQ(limit({{0, 0, 6}, {1, 0, 0, 0}}, even), unknown) << "went past the surface";
}

TEST(OcclusionRadius, GrowsWithTheParallaxOfAStep) {
  const auto radius = [](float step) {
    return math::occlusion_radius<double>(model_of({{step, 0, 0}, {1, 0, 0, 0}}), model_of({}),
                                          0.25, 4);
  };
  // Twice 183 px * step / 4 units.
  EXPECT_EQ(radius(0.0f), 1);
  EXPECT_EQ(radius(0.04f), 1);   // 3.7 px
  EXPECT_EQ(radius(0.05f), 2);   // 4.6 px
  EXPECT_EQ(radius(0.34f), 8);   // 31.1 px
  EXPECT_EQ(radius(0.36f), -1);  // 32.9 px
  EXPECT_EQ(math::occlusion_radius<double>(model_of({}), model_of({}), 0.0, 8), -1) << "no depth";
  // Pixels that are not square: a step down moves things by the longer focal length.
  Camera tall;
  tall.size_px = {320, 180};
  tall.focal_px = {40.0f, 480.0f};
  const auto still = math::make_camera_model(tall);
  tall.world_from_camera.position.y = 0.02f;
  EXPECT_EQ(math::occlusion_radius<double>(math::make_camera_model(tall), still, 0.25, 4), 2);
}

}  // namespace
}  // namespace catgs
