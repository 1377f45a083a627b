#include "render_core/cuda/frame_room.h"

#include <gtest/gtest.h>

namespace catgs::cuda {
namespace {

constexpr int span = 240;
constexpr int patience = 600;

void draw(Room& room, int frames, std::uint32_t needed) {
  for (int i = 0; i < frames; ++i) room.outgrown_by(needed);
}

TEST(Room, GrowsOnceWithAMarginThatTheNextNeedFits) {
  Room room(1000, 1'000'000, span);
  EXPECT_FALSE(room.outgrown_by(1000));
  EXPECT_TRUE(room.outgrown_by(10'000));
  EXPECT_GT(room.size(), 11'000u);
  EXPECT_LT(room.size(), 20'000u);
  EXPECT_FALSE(room.outgrown_by(11'000));
}

TEST(Room, StopsAtItsLimit) {
  Room room(1000, 5000, span);
  EXPECT_TRUE(room.outgrown_by(4'000'000'000u));
  EXPECT_EQ(room.size(), 5000u);
  EXPECT_FALSE(room.outgrown_by(4'000'000'000u));
  EXPECT_EQ(Room(1000, 10, span).size(), 10u);
}

TEST(Room, ComesDownToWhatTheLastSpansNeeded) {
  Room room(1'000'000, 2'000'000, span);
  draw(room, 1, 900'000);
  draw(room, 2 * span - 2, 100'000);
  EXPECT_EQ(room.size(), 1'000'000u);
  draw(room, 1 + span, 100'000);
  EXPECT_LT(room.size(), 200'000u);
  EXPECT_GE(room.size(), 100'000u);
  draw(room, 3 * span, 100'000);
  EXPECT_GE(room.size(), 100'000u);
}

TEST(Room, StaysWhileNowAndThenMoreIsNeeded) {
  Room room(1'000'000, 2'000'000, span);
  for (int i = 0; i < 10; ++i) {
    draw(room, span - 1, 10);
    draw(room, 1, 900'000);
  }
  EXPECT_EQ(room.size(), 1'000'000u);
}

TEST(Room, NeverGrowsByComingDown) {
  for (const std::uint32_t size : {0u, 1u, 4096u, 9000u}) {
    Room room(size, 1'000'000, span);
    draw(room, 4 * span, size / 3);
    EXPECT_LE(room.size(), size);
  }
}

TEST(Room, ForgetsAfterAWhileThatItWasTold) {
  Room room(1'000'000, 2'000'000, span);
  room.shrink_to(0.75);
  EXPECT_EQ(room.size(), 750'000u);
  EXPECT_FALSE(room.outgrown_by(1'500'000));
  draw(room, patience - 1, 700'000);
  EXPECT_TRUE(room.outgrown_by(1'500'000));
  EXPECT_GE(room.size(), 1'500'000u);
}

TEST(FrameRoom, GivesUpSlicesThenListsNeverGaussians) {
  FrameRoom room(4'000'000, 1u << 26, true);
  room.outgrown_by({2'000'000, 8'000'000, 10'000});
  const FrameSizes before = room.sizes();
  EXPECT_GE(before.slices, 10'000u);
  ASSERT_TRUE(room.retreat());
  EXPECT_EQ(room.sizes().slices, 0u);
  EXPECT_EQ(room.sizes().list_entries, before.list_entries);
  ASSERT_TRUE(room.retreat());
  EXPECT_EQ(room.sizes().list_entries, before.list_entries / 4 * 3);
  int retreats = 0;
  while (room.retreat()) ASSERT_LT(++retreats, 100);
  EXPECT_GT(room.sizes().list_entries, 0u);
  EXPECT_EQ(room.sizes().visible, before.visible);
}

TEST(FrameRoom, IsOutgrownByWhatWouldBeMissing) {
  FrameRoom room(100'000, 1u << 20, true);
  EXPECT_FALSE(room.outgrown_by({1000, 1000, 1'000'000}));  // slices only make frames faster
  EXPECT_TRUE(room.outgrown_by({90'000, 1000, 0}));
  EXPECT_TRUE(room.outgrown_by({90'000, 500'000, 0}));
  EXPECT_FALSE(room.outgrown_by({90'000, 500'000, 0}));
}

// The first Gaussians of a scene in pages are coarse, and may have far more entries than the rest.
TEST(FrameRoom, ListsFollowFromSplatsOnlyIfMostWereCounted) {
  FrameRoom few(64'000'000, 1u << 26, true);
  EXPECT_TRUE(few.outgrown_by({8'000'000, 3'000'000, 0}));
  EXPECT_LT(few.sizes().list_entries, 4'000'000u);
  FrameRoom most(64'000'000, 1u << 26, true);
  const std::uint32_t visible = most.sizes().visible / 3 * 4;
  EXPECT_TRUE(most.outgrown_by({visible, 3'000'000, 0}));
  EXPECT_GE(most.sizes().list_entries, 4'000'000u);
}

TEST(FrameRoom, AnEmptySceneAndNoSlicesAreHandled) {
  FrameRoom empty(0, 0, false);
  for (int i = 0; i < 3 * patience; ++i) ASSERT_FALSE(empty.outgrown_by({}));
  EXPECT_GE(empty.sizes().visible, 1u);
  EXPECT_GE(empty.sizes().list_entries, 1u);
  EXPECT_EQ(empty.sizes().slices, 0u);
}

}  // namespace
}  // namespace catgs::cuda
