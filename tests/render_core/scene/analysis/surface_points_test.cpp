#include "render_core/scene/analysis/surface_points.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "tests/support/test_scenes.h"

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
ThreadPool pool(2);

TEST(SurfacePoints, FirstSurfaceThatStopsHalfOfTheLightIsFound) {
  GaussianCloud cloud;
  add_wall(cloud, 20, 2.0f, 0.01f);  // a haze
  add_wall(cloud, 20, 5.0f, 0.9f);
  add_wall(cloud, 20, 9.0f, 0.9f);
  const SurfacePoints surface(cloud, pool);
  const auto hit = surface.hit_along(glm::vec3(0.1f, 0.0f, 0.0f), ahead);
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->distance, 5.0f, 1e-3f);
  EXPECT_LT(hit->spread, 1e-3f);
  EXPECT_NEAR(surface.hit_along(glm::vec3(0.0f, 0.0f, 7.0f), -ahead)->distance, 2.0f, 1e-3f);
}

// Ten thin veils of the same opacity, a unit from the first to the last.
TEST(SurfacePoints, DepthOfTheLightIsReported) {
  GaussianCloud cloud;
  for (int i = 0; i < 10; ++i) add_wall(cloud, 20, 5.0f + static_cast<float>(i) / 9.0f, 0.05f);
  const auto hit = SurfacePoints(cloud, pool).hit_along(glm::vec3(0.1f, 0.0f, 0.0f), ahead);
  ASSERT_TRUE(hit);
  EXPECT_GT(hit->spread, 0.2f);
  EXPECT_LT(hit->spread, 0.5f);
}

TEST(SurfacePoints, LightIsStoppedByWhatIsBeforeItAlone) {
  GaussianCloud cloud;
  add_wall(cloud, 20, 5.0f, 0.9f);
  add_wall(cloud, 20, 9.0f, 0.9f);
  const SurfacePoints surface(cloud, pool);
  const glm::vec3 origin(0.1f, 0.0f, 0.0f);
  EXPECT_EQ(surface.light_from(origin, ahead, 4.9f, 0.1f), 1.0f);
  EXPECT_LT(surface.light_from(origin, ahead, 5.1f, 0.1f), 0.1f);
  EXPECT_EQ(surface.light_from(glm::vec3(0.0f, 0.0f, 6.0f), ahead, 2.9f, 0.1f), 1.0f);
  EXPECT_EQ(surface.light_from(origin, -ahead, 50.0f, 0.1f), 1.0f);
}

TEST(SurfacePoints, EmptyDirectionsHaveNoHit) {
  GaussianCloud cloud;
  add_wall(cloud, 20, 5.0f, 0.9f);
  const SurfacePoints surface(cloud, pool);
  EXPECT_FALSE(surface.hit_along(glm::vec3(3.0f, 0.0f, 0.0f), ahead));
  EXPECT_FALSE(surface.hit_along(glm::vec3(0.0f), -ahead));
  EXPECT_FALSE(SurfacePoints(GaussianCloud{}, pool).hit_along(glm::vec3(0.0f), ahead));
}

TEST(SurfacePoints, SamplesOfLargeScenesGiveTheSamePoint) {
  GaussianCloud cloud;
  add_wall(cloud, 100, 5.0f, 0.9f);
  const SurfacePoints sample(cloud, pool, 500);
  for (const float x : {-0.4f, -0.11f, 0.0f, 0.27f}) {
    const auto hit = sample.hit_along(glm::vec3(x, 0.1f, 0.0f), ahead);
    ASSERT_TRUE(hit) << x;
    EXPECT_NEAR(hit->distance, 5.0f, 1e-3f);
  }
}

/// Where half of the light is stopped, looked for among all.
std::optional<float> brute_force(const GaussianCloud& cloud, const glm::dvec3& origin,
                                 const glm::dvec3& direction) {
  std::vector<std::pair<double, double>> stops;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double sigma = cloud.scale[i].x;
    const glm::dvec3 offset = glm::dvec3(cloud.mean[i]) - origin;
    const double along = glm::dot(offset, direction);
    const double beside = glm::length(offset - along * direction) / sigma;
    if (along > sigma && beside <= 3.0)
      stops.emplace_back(along, cloud.opacity[i] * std::exp(-0.5 * beside * beside));
  }
  std::ranges::sort(stops);
  double left = 1.0;
  for (const auto& [distance, alpha] : stops)
    if ((left *= 1.0 - alpha) <= 0.5) return static_cast<float>(distance);
  return std::nullopt;
}

TEST(SurfacePoints, HitsAreThoseOfBruteForce) {
  GaussianCloud cloud = test::random_cloud(20'000, 0, 1);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    cloud.scale[i] = glm::vec3(i % 1000 == 0 ? 0.3f : 0.02f);
  const SurfacePoints surface(cloud, pool);
  int met = 0;
  for (int k = 0; k < 200; ++k) {
    const float angle = 0.1f * static_cast<float>(k);
    const glm::vec3 direction =
        glm::normalize(glm::vec3(std::cos(angle), 0.3f * std::sin(3.0f * angle), std::sin(angle)));
    const glm::vec3 origin = cloud.mean[static_cast<std::size_t>(k)] - 2.0f * direction;
    const auto expected = brute_force(cloud, origin, direction);
    const auto hit = surface.hit_along(origin, direction);
    ASSERT_EQ(hit.has_value(), expected.has_value()) << k;
    if (!expected) continue;
    EXPECT_NEAR(hit->distance, *expected, 1e-4f) << k;
    ++met;
  }
  EXPECT_GT(met, 100);
}

}  // namespace
}  // namespace catgs
