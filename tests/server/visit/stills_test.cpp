// The picture that stays when the camera rests.

#include "tests/server/visit/visit_fixture.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

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

TEST_F(StillTest, FollowsTheVisitorsRequest) {
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
