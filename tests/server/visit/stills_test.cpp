// The picture that stays when the camera rests.

#include "tests/server/visit/visit_fixture.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

class StillTest : public test::VisitTest {
 protected:
  /// Moving pictures of 426x240, whatever the reason, and still ones of 1280x720.
  static Settings small_in_motion() {
    Settings settings;
    settings.size_px = {426, 240};
    settings.still_size_px = {1280, 720};
    return settings;
  }
  FrameOrder shown() {
    const FrameOrder order = run_frame();
    ack(order.ticket.frame_id);
    return order;
  }
  FrameOrder moved() {
    now += 17ms;
    ++poses_;
    pose(poses_, static_cast<float>(poses_));
    return shown();
  }
  FrameOrder rested() {
    now += policy.still_after;
    EXPECT_TRUE(frame_is_due());
    return shown();
  }
  std::uint64_t poses_ = 0;
};

TEST_F(StillTest, IsOfItsOwnSizeAndSoIsMotionAfterIt) {
  greet(small_in_motion());
  for (int i = 0; i < 5; ++i) EXPECT_EQ(moved().ticket.size_px, glm::ivec2(426, 240));
  const FrameOrder still = rested();
  EXPECT_TRUE(still.ticket.still);
  EXPECT_FALSE(still.ticket.refined);
  EXPECT_TRUE(still.force_idr);
  EXPECT_EQ(still.ticket.size_px, glm::ivec2(1280, 720));
  EXPECT_EQ(still.encoding.size_px, still.ticket.size_px);
  EXPECT_EQ(still.request.camera.size_px, still.ticket.size_px);
  ASSERT_EQ(host.count<StreamConfig>(), 1);
  EXPECT_EQ(session.stream().config().size_px, glm::ivec2(1280, 720));
  EXPECT_EQ(session.stream().config().fps, policy.default_fps) << "that of moving pictures";

  now += 70ms;
  ASSERT_TRUE(frame_is_due());
  const FrameOrder refinement = shown();
  EXPECT_TRUE(refinement.ticket.refined);
  EXPECT_FALSE(refinement.force_idr);
  EXPECT_EQ(refinement.ticket.size_px, still.ticket.size_px);

  now += 1ms;
  pose(++poses_, 100.0f);
  ASSERT_TRUE(frame_is_due()) << "motion waits for no refinement";
  const FrameOrder moving = shown();
  EXPECT_EQ(moving.ticket.size_px, glm::ivec2(426, 240));
  EXPECT_TRUE(moving.force_idr);
  EXPECT_EQ(session.stream().config().size_px, glm::ivec2(426, 240));
  EXPECT_FALSE(moved().force_idr);
}

TEST_F(StillTest, TheLadderAndWishesForMotionLeaveItAlone) {
  greet(small_in_motion());
  sharp = true;
  moved();
  rested();
  Settings larger = small_in_motion();
  larger.size_px = {640, 360};
  session.on_message(larger, now);
  session.stream().plan().use_effort({.preset = 0, .threads = 2});
  session.on_tick(now += 1s);
  EXPECT_FALSE(session.next_frame());
  EXPECT_EQ(moved().ticket.size_px, glm::ivec2(640, 360));
}

TEST_F(StillTest, FollowsTheVisitorsWish) {
  greet(small_in_motion());
  sharp = true;
  moved();
  rested();
  now += 1s;
  Settings coarser = small_in_motion();
  coarser.still_size_px = {640, 360};
  session.on_message(coarser, now);
  ASSERT_TRUE(frame_is_due());
  EXPECT_EQ(shown().ticket.size_px, glm::ivec2(640, 360));
  now += 1s;
  EXPECT_FALSE(session.next_frame());
}

}  // namespace
}  // namespace catgs
