#include "render_core/scene/surface_points.h"

#include <gtest/gtest.h>

namespace catgs {
namespace {

/// A wall of `side` x `side` flat Gaussians a unit wide, at distance z.
void add_wall(GaussianCloud& cloud, int side, float z, float opacity) {
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      const float step = 1.0f / static_cast<float>(side);
      cloud.mean.emplace_back((static_cast<float>(column) + 0.5f) * step - 0.5f,
                              (static_cast<float>(row) + 0.5f) * step - 0.5f, z);
      cloud.scale.emplace_back(step, step, 0.01f * step);
      cloud.rotation.emplace_back(1.0f, 0.0f, 0.0f, 0.0f);
      cloud.opacity.push_back(opacity);
      cloud.sh.emplace_back(0.0f);
    }
}

constexpr glm::vec3 ahead(0.0f, 0.0f, 1.0f);

TEST(SurfacePoints, FindsTheFirstThingThatStopsHalfOfTheLight) {
  GaussianCloud cloud;
  add_wall(cloud, 20, 2.0f, 0.01f);  // a haze
  add_wall(cloud, 20, 5.0f, 0.9f);
  add_wall(cloud, 20, 9.0f, 0.9f);
  const SurfacePoints surface(cloud);
  const auto distance = surface.distance_along(glm::vec3(0.1f, 0.0f, 0.0f), ahead);
  ASSERT_TRUE(distance);
  EXPECT_NEAR(*distance, 5.0f, 1e-3f);
  EXPECT_NEAR(*surface.distance_along(glm::vec3(0.0f, 0.0f, 7.0f), -ahead), 2.0f, 1e-3f);
}

TEST(SurfacePoints, SaysWhereNothingIs) {
  GaussianCloud cloud;
  add_wall(cloud, 20, 5.0f, 0.9f);
  const SurfacePoints surface(cloud);
  EXPECT_FALSE(surface.distance_along(glm::vec3(3.0f, 0.0f, 0.0f), ahead));
  EXPECT_FALSE(surface.distance_along(glm::vec3(0.0f), -ahead));
  EXPECT_FALSE(SurfacePoints(GaussianCloud{}).distance_along(glm::vec3(0.0f), ahead));
}

TEST(SurfacePoints, FindsTheSameInASampleOfALargeScene) {
  GaussianCloud cloud;
  add_wall(cloud, 100, 5.0f, 0.9f);
  const SurfacePoints sample(cloud, 500);
  for (const float x : {-0.4f, -0.11f, 0.0f, 0.27f}) {
    const auto distance = sample.distance_along(glm::vec3(x, 0.1f, 0.0f), ahead);
    ASSERT_TRUE(distance) << x;
    EXPECT_NEAR(*distance, 5.0f, 1e-3f);
  }
}

}  // namespace
}  // namespace catgs
