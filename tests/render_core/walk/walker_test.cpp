#include "tests/support/walker.h"

#include <gtest/gtest.h>

#include "render_core/base/portable.h"
#include "tests/render_core/walk/hand_made_map.h"

namespace catgs::walk {
namespace {

constexpr Kind nothing{9};

/// A square with a wall across, which a gap at its upper end passes.
WalkMap yard() {
  return test::hand_made_map(
      {40, 40}, [](int x, int y) { return x == 20 && y < 35 ? Kind::obstacle : Kind::clear; });
}

TEST(Walker, GoesStraightOverFreeGround) {
  const WalkMap map = yard();
  const Stand at = move(map, {{5.5f, 5.5f}, 10.0f}, {10.0f, 7.0f});
  EXPECT_NEAR(at.place.x, 15.5f, 1e-3f);
  EXPECT_NEAR(at.place.y, 12.5f, 1e-3f);
  EXPECT_EQ(at.height, 10.0f);
}

TEST(Walker, StopsAtAWallAndSlidesAlongIt) {
  const WalkMap map = yard();
  const Stand head_on = move(map, {{15.5f, 5.5f}, 10.0f}, {10.0f, 0.0f});
  EXPECT_LT(head_on.place.x, 20.0f);
  EXPECT_GT(head_on.place.x, 19.0f);
  const Stand aslant = move(map, {{15.5f, 5.5f}, 10.0f}, {10.0f, 10.0f});
  EXPECT_LT(aslant.place.x, 20.0f);
  EXPECT_GT(aslant.place.y, 13.0f);
}

TEST(Walker, NeverLeavesClearGround) {
  const WalkMap map = test::hand_made_map({60, 60}, [](int x, int y) {
    const auto bits = mix_bits(static_cast<std::uint64_t>(x * 64 + y) + golden_gamma);
    return x + y > 4 && bits % 4 == 0 ? (bits % 8 == 0 ? Kind::obstacle : nothing) : Kind::clear;
  });
  SplitMix64 random(7);
  Stand at{{0.5f, 0.5f}, 10.0f};
  for (int k = 0; k < 2000; ++k) {
    const auto part = [&] { return static_cast<float>(random.next() % 2001) * 0.01f - 10.0f; };
    at = move(map, at, {part(), part()});
    ASSERT_TRUE(map.clear_at(glm::ivec2(at.place), at.height)) << at.place.x << " " << at.place.y;
  }
}

TEST(Walker, TurnsNoCornerThatIsClosed) {
  const WalkMap map = test::hand_made_map(
      {2, 2}, [](int x, int y) { return x == y ? Kind::clear : Kind::obstacle; });
  const Stand at = move(map, {{0.9f, 0.9f}, 10.0f}, {0.3f, 0.3f});
  EXPECT_LT(at.place.x, 1.0f);
  EXPECT_TRUE(find_path(map, at, {{1.5f, 1.5f}, 10.0f}).empty());
}

TEST(Walker, FindsTheWayAroundAWall) {
  const WalkMap map = yard();
  const Stand from{{15.5f, 5.5f}, 10.0f}, to{{25.5f, 5.5f}, 10.0f};
  const std::vector<Stand> path = find_path(map, from, to);
  ASSERT_GE(path.size(), 3u);
  EXPECT_EQ(path.front().place, from.place);
  EXPECT_EQ(path.back().place, to.place);
  float length = 0.0f;
  for (std::size_t k = 1; k < path.size(); ++k) {
    EXPECT_TRUE(straight(map, path[k - 1], path[k]));
    length += glm::distance(path[k - 1].place, path[k].place);
  }
  // Twice from (15.5, 5.5) to the end of the wall at (20, 35).
  EXPECT_GT(length, 59.5f);
  EXPECT_LT(length, 64.0f);
  EXPECT_LE(path.size(), 8u);
}

TEST(Walker, NoWayIsNone) {
  const WalkMap map =
      test::hand_made_map({40, 10}, [](int x, int) { return x == 20 ? nothing : Kind::clear; });
  EXPECT_TRUE(find_path(map, {{5.5f, 5.5f}, 10.0f}, {{30.5f, 5.5f}, 10.0f}).empty());
  EXPECT_TRUE(find_path(map, {{5.5f, 5.5f}, 10.0f}, {{20.5f, 5.5f}, 10.0f}).empty());
  EXPECT_TRUE(find_path(map, {{-5.5f, 5.5f}, 10.0f}, {{5.5f, 5.5f}, 10.0f}).empty());
}

}  // namespace
}  // namespace catgs::walk
