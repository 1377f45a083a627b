#include "render_core/walk/walkable_area.h"

#include <atomic>

#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "render_core/base/portable.h"
#include "render_core/walk/eye_height.h"
#include "render_core/walk/inhabited_area.h"
#include "render_core/walk/walk_file.h"
#include "tests/render_core/walk/worlds.h"
#include "tests/support/walker.h"

namespace catgs::walk {
namespace {

Stand stand_at(const WalkMap& map, const glm::vec3& position) {
  const auto stand = stand_below(map, position);
  EXPECT_TRUE(stand) << position.x << " " << position.y;
  return stand.value_or(Stand{});
}

TEST(WalkableArea, ADoorIsPassedAndANarrowGapIsNot) {
  const glm::vec3 start(2, 2, 1.6f), beyond(6, 3, 1.6f);
  const WalkMap wide = test::map_of(test::room(0.9f), start);
  EXPECT_FALSE(find_path(wide, stand_at(wide, start), stand_at(wide, beyond)).empty());
  const WalkMap narrow = test::map_of(test::room(0.4f), start);
  EXPECT_TRUE(stand_below(narrow, start));
  EXPECT_FALSE(stand_below(narrow, beyond));
}

TEST(WalkableArea, KeepsABodysRadiusFromWallsAndKnowsTablesFromWalls) {
  const WalkMap map = test::map_of(test::room(0.9f), {2, 2, 1.6f});
  EXPECT_FALSE(stand_below(map, {0.15f, 2, 1}));
  EXPECT_TRUE(stand_below(map, {0.45f, 2, 1}));
  EXPECT_FALSE(stand_below(map, {1.5f, 4.5f, 1.6f}));  // under the table, and on it
  const auto has = [&](const glm::vec3& position, Kind kind) {
    for (const Position& p : map.at(glm::ivec2(map.grid.from_world(position))))
      if (p.kind == kind) return true;
    return false;
  };
  EXPECT_TRUE(has({1.05f, 4.5f, 0}, Kind::low));
  EXPECT_TRUE(has({4.02f, 1, 0}, Kind::obstacle));
  EXPECT_TRUE(has({2, 0.2f, 0}, Kind::near));
  EXPECT_TRUE(has({2, 1, 0}, Kind::clear));
}

TEST(WalkableArea, TheRoofIsNotReached) {
  const WalkMap map = test::map_of(test::room(0.9f), {2, 2, 1.6f});
  ASSERT_EQ(map.storeys.size(), 1u);
  for (const Position& position : map.positions)
    EXPECT_NEAR(position.cells(), map.start.height, 1.0f);
}

TEST(WalkableArea, StairsAreClimbedToAnotherStorey) {
  const WalkMap map = test::map_of(test::stairs(), {0, 3, 1.6f});
  const Stand below = stand_at(map, {0, 3, 1.6f}), above = stand_at(map, {9, 3, 4.3f});
  EXPECT_NEAR((above.height - below.height) * map.grid.cell, 2.72f, 0.05f);
  Stand at = below;
  float largest_rise = 0.0f;
  for (const Stand& turn : find_path(map, below, above))
    for (int k = 0; k < 400 && glm::distance(at.position, turn.position) > 0.01f; ++k) {
      const glm::vec2 way = turn.position - at.position;
      const Stand next = move(map, at, way * std::min(1.0f, 0.5f / glm::length(way)));
      largest_rise = std::max(largest_rise, std::abs(next.height - at.height));
      at = next;
    }
  EXPECT_NEAR(at.height, above.height, 0.5f);
  EXPECT_LT(largest_rise, Person::in_cells(map.person.step));
  ASSERT_EQ(map.storeys.size(), 2u);
  EXPECT_EQ(map.storey_at(below.height), 0u);
  EXPECT_EQ(map.storey_at(above.height), 1u);
}

TEST(WalkableArea, NobodyFallsFromAnEdge) {
  const WalkMap map = test::map_of(test::stairs(), {9, 3, 4.3f});
  Stand at = stand_at(map, {9, 3, 4.3f});
  for (int k = 0; k < 200; ++k) at = move(map, at, {-0.5f, 0.0f});  // towards the edge at 6.48
  const glm::vec3 eyes = eyes_of(map, at);
  EXPECT_GT(eyes.x, 6.48f);
  EXPECT_NEAR(eyes.z, 2.72f + test::eye_m, 0.1f);
}

TEST(WalkableArea, ARandomWalkPassesTheDoorAndNoWall) {
  const glm::vec3 start(2, 2, 1.6f);
  const WalkMap map = test::map_of(test::room(0.9f), start);
  SplitMix64 random(1);
  const auto random_way = [&] {
    const float angle = 6.2831853f * static_cast<float>(random.next() >> 40) * 0x1p-24f;
    return 0.4f * glm::vec2(std::cos(angle), std::sin(angle));
  };
  Stand at = stand_at(map, start);
  glm::vec3 before = eyes_of(map, at);
  int crossings = 0;
  for (int leg = 0; leg < 400; ++leg) {
    const glm::vec2 way = random_way();
    for (int k = 0; k < 100; ++k) {
      at = move(map, at, way);
      const glm::vec3 eyes = eyes_of(map, at);
      ASSERT_TRUE(eyes.x > 0.15f && eyes.x < 7.85f && eyes.y > 0.15f && eyes.y < 5.85f);
      ASSERT_NEAR(eyes.z, test::eye_m, 0.1f);
      ASSERT_FALSE(eyes.x > 1.0f && eyes.x < 2.0f && eyes.y > 4.0f && eyes.y < 5.0f) << "table";
      if ((before.x < 4.0f) != (eyes.x < 4.0f)) {
        ++crossings;
        ASSERT_TRUE(eyes.y > 2.5f && eyes.y < 3.4f) << eyes.y;
      }
      before = eyes;
    }
  }
  EXPECT_GT(crossings, 1);
}

TEST(WalkableArea, ShinyFloorIsFloor) {
  const WalkMap map = test::map_of(test::shiny_room(), {2, 3, 1.6f});
  std::size_t clear = 0;
  for (const Position& position : map.positions) clear += position.kind == Kind::clear ? 1 : 0;
  EXPECT_GT(clear, 3800u) << "of 48 square metres";
  const Stand beyond = stand_at(map, {6, 3, 1.6f});
  EXPECT_NEAR(eyes_of(map, beyond).z, 1.6f, 0.1f);
  EXPECT_FALSE(find_path(map, stand_at(map, {2, 3, 1.6f}), beyond).empty());
}

TEST(WalkableArea, ATerraceIsLeftOverNoRailing) {
  ThreadPool pool(2);
  const GaussianCloud cloud = test::villa();
  SceneHints hints;
  hints.up = {0, 0, 1};
  hints.start_pose.position = test::terrace_start;
  const std::vector<float> heights = eye_heights_of(cloud, hints);
  const WalkMap map =
      find_inhabited_area({.name = "villa",
                           .start = hints.start_pose.position,
                           .up = hints.up,
                           .eye_heights = heights,
                           .add_scene = [&](Occupancy& occupancy) { occupancy.add(cloud, pool); }},
                          pool);
  EXPECT_NEAR(map.grid.cell * cells_per_eye_height, 1.6f, 0.3f);
  EXPECT_NEAR(eyes_of(map, map.start).z, 2.9f + 1.6f, 0.4f);
  EXPECT_TRUE(stand_below(map, {4, 3, 4.5f})) << "through the door";
  EXPECT_FALSE(stand_below(map, {-8, 3, 4.5f})) << "the lawn";
}

TEST(WalkableArea, TheHeightWhoseAreaIsInhabitedWins) {
  ThreadPool pool(2);
  const GaussianCloud cloud = test::room(0.9f);
  const auto eye_height = [&](std::vector<float> heights, const glm::vec3& start) {
    const WalkMap map = find_inhabited_area(
        {.name = "room",
         .start = start,
         .up = {0, 0, 1},
         .eye_heights = heights,
         .add_scene = [&](Occupancy& occupancy) { occupancy.add(cloud, pool); }},
        pool);
    return map.grid.cell * cells_per_eye_height;
  };
  EXPECT_FLOAT_EQ(eye_height({3.1f, 0.4f, 1.6f}, {2, 2, 1.5f}), 1.6f);
  EXPECT_FLOAT_EQ(eye_height({1.6f, 1.2f}, {2, 2, 5.0f}), 1.6f) << "none is inhabited";
  EXPECT_THROW(eye_height({3.1f, 9.0f}, {2, 2, 1.5f}), InputError);
}

TEST(WalkableArea, SteepSlopesAreNotWalkable) {
  for (const float degrees : {30.0f, 60.0f}) {
    GaussianCloud cloud;
    test::add_plate(cloud, {0, 0, 0}, {4, 0, 0}, {0, 6, 0});
    const float rise = 3.0f * std::tan(degrees * 0.0174533f);
    test::add_plate(cloud, {4, 0, 0}, {3, 0, rise}, {0, 6, 0});
    const WalkMap map = test::map_of(cloud, {2, 3, 1.6f});
    EXPECT_EQ(stand_below(map, {5.5f, 3, 5}).has_value(), degrees < 45.0f) << degrees;
  }
}

TEST(WalkableArea, IsTheSameForAnyNumberOfThreads) {
  const GaussianCloud cloud = test::room(0.9f);
  EXPECT_EQ(pack(test::map_of(cloud, {2, 2, 1.6f}, 1)), pack(test::map_of(cloud, {2, 2, 1.6f}, 3)));
}

TEST(WalkableArea, EndsWhereItsProgressThrows) {
  struct Stop {};
  ThreadPool pool(2);
  const GaussianCloud cloud = test::room(0.9f);
  const glm::vec3 start(2, 2, 1.6f);
  Occupancy occupancy(grid_around(start, {0, 0, 1}, test::eye_m));
  EXPECT_THROW(occupancy.add(cloud, pool, [] { throw Stop(); }), Stop);
  occupancy.add(cloud, pool);
  std::atomic<int> calls = 0;
  find_walkable_area(occupancy, {}, start, "test", pool, [&] { ++calls; });
  EXPECT_GT(calls, 70) << "rows of columns, and the loops behind them";
  for (int last = 1; last <= calls; ++last) {
    std::atomic<int> left = last;
    const auto progress = [&] {
      if (--left == 0) throw Stop();
    };
    EXPECT_THROW(find_walkable_area(occupancy, {}, start, "test", pool, progress), Stop) << last;
  }
}

TEST(WalkableArea, ASceneWithoutWalkableAreaIsRefused) {
  EXPECT_THROW(test::map_of(test::room(0.9f), {2, 2, -5}), InputError);
  EXPECT_THROW(test::map_of({}, {0, 0, 0}), InputError);
}

}  // namespace
}  // namespace catgs::walk
