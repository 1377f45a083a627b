#include "render_core/walk/occupancy.h"

#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/render_core/walk/worlds.h"

namespace catgs::walk {
namespace {

const Grid grid = grid_around({0, 0, 0}, {0, 0, 1}, test::eye_m);

std::vector<walk::Run> runs_at(const Occupancy& occupancy, const glm::vec3& position) {
  std::vector<walk::Run> runs;
  occupancy.append_runs(glm::ivec2(grid.from_world(position)), runs);
  return runs;
}

Occupancy filled(const GaussianCloud& cloud, int threads = 2) {
  ThreadPool pool(threads);
  Occupancy occupancy(grid);
  occupancy.add(cloud, pool);
  return occupancy;
}

GaussianCloud plate() {
  GaussianCloud cloud;
  test::add_plate(cloud, {-2, -2, 0.43f}, {4, 0, 0}, {0, 4, 0});
  return cloud;
}

TEST(WalkGrid, EastNorthAndUpAreRightHanded) {
  // A capture has y down: north is +z, so that a plan shows the scene as seen from above.
  const Grid capture = grid_around({1, 2, 3}, {0, -1, 0}, 1.6f);
  EXPECT_EQ(capture.axes[0], glm::vec3(1, 0, 0));
  EXPECT_EQ(capture.axes[1], glm::vec3(0, 0, 1));
  const glm::vec3 there = capture.from_world({2, 2, 3}) - capture.from_world({1, 2, 3});
  EXPECT_NEAR(there.x, 10.0f, 1e-2f);
  EXPECT_NEAR(glm::distance(capture.to_world(capture.from_world({5, 6, 7})), {5, 6, 7}), 0.0f,
              1e-3f);
}

TEST(Occupancy, TakesNoMoreBlocksThanAllowed) {
  ThreadPool pool(2);
  Occupancy enough(grid, 4096);
  enough.add(plate(), pool);
  Occupancy small(grid, 64);
  EXPECT_THROW(small.add(plate(), pool), InputError);
  EXPECT_LE(small.bytes(), enough.bytes());
}

TEST(Occupancy, APlateIsARunAtItsHeight) {
  const Occupancy occupancy = filled(plate());
  for (const float x : {-1.5f, 0.01f, 1.5f}) {
    const std::vector<walk::Run> runs = runs_at(occupancy, {x, 0.3f, 0});
    ASSERT_EQ(runs.size(), 1u);
    EXPECT_NEAR(runs[0].top, grid.from_world({0, 0, 0.43f}).z, 0.1f);
    EXPECT_EQ(runs[0].high, runs[0].low + 1);
  }
  EXPECT_TRUE(runs_at(occupancy, {2.5f, 0, 0}).empty());
}

TEST(Occupancy, LargeGaussiansHaveNoHolesAndFaintOnesAreNotSolid) {
  GaussianCloud cloud;
  cloud.resize(2, 0);
  cloud.mean = {{0, 0, 0.05f}, {0, 0, 1.05f}};
  cloud.rotation = {glm::quat(1, 0, 0, 0), glm::quat(1, 0, 0, 0)};
  cloud.scale = {{2, 2, 0.01f}, {2, 2, 0.01f}};
  cloud.opacity = {0.95f, 0.2f};
  const Occupancy occupancy = filled(cloud);
  for (float x = -2.0f; x < 2.0f; x += 0.1f)
    EXPECT_EQ(runs_at(occupancy, {x, 0.5f, 0}).size(), 1u) << x;
}

TEST(Occupancy, GaussiansBeyondTheGridAreIgnored) {
  GaussianCloud cloud;
  cloud.resize(3, 0);
  cloud.mean = {{1e9f, 0, 0}, {0, -1e9f, 0}, {0, 0, 300}};
  cloud.rotation.assign(3, glm::quat(1, 0, 0, 0));
  cloud.scale.assign(3, glm::vec3(1e3f));
  cloud.opacity.assign(3, 0.9f);
  cloud.scale[2] = glm::vec3(0.1f);
  EXPECT_EQ(filled(cloud).bytes(), Occupancy(grid).bytes());
}

TEST(Occupancy, IsTheSameForAnyNumberOfThreads) {
  const GaussianCloud cloud = test::room(1.0f);
  std::vector<walk::Run> runs[2];
  for (const int threads : {1, 3}) {
    const Occupancy occupancy = filled(cloud, threads);
    for (float x = 0.05f; x < 8.0f; x += 0.1f)
      occupancy.append_runs(glm::ivec2(grid.from_world({x, 3, 0})), runs[threads / 2]);
  }
  ASSERT_EQ(runs[0].size(), runs[1].size());
  for (std::size_t k = 0; k < runs[0].size(); ++k) EXPECT_EQ(runs[0][k].top, runs[1][k].top);
}

}  // namespace
}  // namespace catgs::walk
