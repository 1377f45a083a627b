#include "render_core/scene/clusters.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

TEST(MortonOrder, EveryGaussianIsListedOnceAndBesideItsNeighbours) {
  ThreadPool pool(2);
  const GaussianCloud cloud = test::random_cloud(20'000, 0, 1);
  const std::vector<std::uint32_t> order = morton_order(cloud.mean, pool);
  std::vector<std::uint32_t> sorted = order, all(cloud.size());
  std::ranges::sort(sorted);
  std::iota(all.begin(), all.end(), 0u);
  EXPECT_EQ(sorted, all);

  // A box of 256 out of 20000 in a cube of side 4 would have a side of 0.94 if clusters were cubes;
  // in the order of the file, nearly 4.
  double sides = 0.0;
  for (std::size_t c = 0; c < clusters_of(order.size()); ++c) {
    glm::vec3 low = cloud.mean[order[c * cluster_size]], high = low;
    const std::size_t end = std::min(order.size(), (c + 1) * cluster_size);
    for (std::size_t slot = c * cluster_size; slot < end; ++slot) {
      low = glm::min(low, cloud.mean[order[slot]]);
      high = glm::max(high, cloud.mean[order[slot]]);
    }
    sides += (high.x - low.x + high.y - low.y + high.z - low.z) / 3.0;
  }
  EXPECT_LT(sides / static_cast<double>(clusters_of(order.size())), 1.6);
}

TEST(MortonOrder, EqualPlacesKeepTheirOrder) {
  ThreadPool pool(2);
  GaussianCloud cloud = test::random_cloud(1000, 0, 2);
  std::ranges::fill(cloud.mean, glm::vec3(3.0f));
  std::vector<std::uint32_t> all(cloud.size());
  std::iota(all.begin(), all.end(), 0u);
  EXPECT_EQ(morton_order(cloud.mean, pool), all);
  EXPECT_TRUE(morton_order({}, pool).empty());
}

TEST(ClusterBounds, BoundsHoldAddedGaussians) {
  const GaussianCloud cloud = test::random_cloud(256, 0, 3);
  ClusterBounds bounds;
  double farthest = 0.0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double sigma = glm::length(glm::dvec3(cloud.scale[i]));
    bounds.add(cloud.mean[i], sigma, std::log2(cloud.opacity[i]));
    // alpha = opacity exp(-r^2 / 2) falls under 1/255 here.
    const double visible = 255.0 * static_cast<double>(cloud.opacity[i]);
    farthest = std::max(farthest, sigma * std::sqrt(2.0 * std::log(std::max(1.0, visible))));
  }
  const Cluster cluster = bounds.cluster();
  for (const glm::vec3& mean : cloud.mean) {
    const glm::vec3 off = glm::abs(mean - cluster.centre);
    EXPECT_LE(off.x, cluster.half_extent.x);
    EXPECT_LE(off.y, cluster.half_extent.y);
    EXPECT_LE(off.z, cluster.half_extent.z);
  }
  EXPECT_GE(cluster.reach, farthest * (1.0 - 1e-7));
  EXPECT_LE(cluster.reach, farthest * (1.0 + 1e-5));
}

TEST(ClusterBounds, InvisibleGaussiansHaveNoReach) {
  ClusterBounds bounds;
  bounds.add({1, 2, 3}, 5.0, std::log2(0.003f));  // fainter than 1/255
  EXPECT_EQ(bounds.cluster().reach, 0.0f);
}

// A cluster that goes from the left of the image to its right is outside at both ends and inside in
// between.
TEST(ClusterCuller, ClustersCrossedOnTheWayAreKept) {
  const auto camera = [](float x) {
    return make_camera({{x, 0, 0}, glm::quat(1, 0, 0, 0)}, {100, 100}, 50.0f);
  };
  const Cluster cluster{{0, 0, 4}, glm::vec3(0.1f), 0.1f};
  const ClusterCuller left(camera(-10)), middle(camera(0)), right(camera(10)), farther(camera(20));
  EXPECT_TRUE(left.outside(cluster));
  EXPECT_FALSE(middle.outside(cluster));
  EXPECT_TRUE(right.outside(cluster));
  EXPECT_FALSE(outside_on_the_way(left, right, cluster));
  EXPECT_TRUE(outside_on_the_way(right, farther, cluster));
  EXPECT_TRUE(outside_on_the_way(right, right, cluster));
  EXPECT_FALSE(outside_on_the_way(middle, right, cluster));
}

TEST(ColoursHold, ColoursHoldUntilTheNearestDirectionTurns) {
  const Cluster cluster{{0, 0, 10}, {1, 1, 2}, 5.0f};  // nearest mean 8 away from the origin
  const glm::vec3 here(0.0f);
  const auto step = static_cast<float>(8.0 * colour_reuse_rad);
  EXPECT_TRUE(colours_hold(cluster, here, here));
  EXPECT_TRUE(colours_hold(cluster, {0.99f * step, 0, 0}, here));
  EXPECT_FALSE(colours_hold(cluster, {0, -1.01f * step, 0}, here));
  // Within the box some may be at hand.
  EXPECT_FALSE(colours_hold(cluster, {0, 0, 10}, {0, 1e-3f, 10}));
}

}  // namespace
}  // namespace catgs
