#include "render_core/walk/plan.h"

#include <gtest/gtest.h>

#include "tests/render_core/walk/hand_made_map.h"
#include "tests/render_core/walk/worlds.h"

namespace catgs::walk {
namespace {

TEST(Plan, NorthIsUpAndEastIsRight) {
  const WalkMap map = test::hand_made_map({16, 8}, [](int x, int y) {
    return x == 15 && y == 7 ? Kind::obstacle : x == 15 ? Kind::low : Kind::clear;
  });
  const Image plan = draw_plan(map, 0);
  ASSERT_EQ(plan.size_px, glm::ivec2(1024, 512));
  const auto red = [&](int x, int y) { return plan.row(y)[3 * x]; };
  EXPECT_LT(red(1000, 20), 0.3f);              // a wall in the north-east
  EXPECT_NEAR(red(1000, 400), 0.6f, 0.1f);     // furniture in the south-east
  EXPECT_EQ(red(400, 100), 1.0f);              // ground
  EXPECT_LT(plan.row(480)[3 * 32 + 1], 0.3f);  // the start is red
}

TEST(Plan, AStoreyShowsItsOwnPlaces) {
  const WalkMap map = test::map_of(test::stairs(), {0, 3, 1.6f});
  ASSERT_EQ(map.storeys.size(), 2u);
  const auto white = [&](std::size_t storey) {
    const Image plan = draw_plan(map, storey);
    std::size_t count = 0;
    for (std::size_t k = 0; k < plan.pixels(); ++k) count += plan.rgb[3 * k] > 0.9f;
    return static_cast<double>(count) / static_cast<double>(plan.pixels());
  };
  EXPECT_GT(white(0), 0.5);
  EXPECT_GT(white(1), 0.15);
  EXPECT_LT(white(1), 0.35);
}

TEST(Plan, NamesTheAxisThatIsNorth) {
  EXPECT_EQ(north_of(grid_around({0, 0, 0}, {0, -1, 0}, 1.6f)), "+z");
  EXPECT_EQ(north_of(grid_around({0, 0, 0}, {0, 0, 1}, 1.6f)), "+y");
  EXPECT_EQ(north_of(grid_around({0, 0, 0}, {0, 1, 0}, 1.6f)), "-z");
}

}  // namespace
}  // namespace catgs::walk
