// When a session's frames are IDRs.

#include "tests/server/visit/visit_fixture.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

using test::VisitTest;

TEST_F(VisitTest, AsksForAnIdrAfterADrop) {
  greet();
  pose(1, 0.0f);
  host.drop_next = {1};
  run_frame();
  pose(2, 1.0f);
  now += 1s;
  ASSERT_TRUE(frame_is_due()) << "a dropped frame is not in flight";
  EXPECT_TRUE(run_frame().force_idr);
  EXPECT_EQ(session.statistics().frames_dropped(), 1u);
  EXPECT_EQ(session.statistics().frames_sent(), 1u) << "what was dropped was not sent";
  EXPECT_EQ(session.statistics().bytes_sent(), 100u);
}

TEST_F(VisitTest, DropsThatGoOnCostFewIdrsAndNoFrameInVain) {
  greet();
  int idrs = 0;
  int frames = 0;
  for (std::uint64_t ms = 1; ms <= 10'000; ++ms) {
    now += 1ms;
    pose(ms, 0.01f * static_cast<float>(ms));
    if (!frame_is_due()) continue;
    host.drop_next = {session.statistics().frames_sent() + session.statistics().frames_dropped() +
                      1};  // a socket that is full
    const FrameOrder order = run_frame();
    idrs += order.force_idr ? 1 : 0;
    ++frames;
  }
  EXPECT_EQ(idrs, frames) << "after a drop nothing else is of use";
  // 0, 0.25, 0.75, 1.75, then every two seconds.
  EXPECT_LE(idrs, 8);
  EXPECT_GE(idrs, 6);

  now += 10s;
  pose(20'000, 0.0f);
  ASSERT_TRUE(frame_is_due());
  ack(run_frame().ticket.frame_id);
  now += 1s;
  pose(20'001, 1.0f);
  host.drop_next = {session.statistics().frames_sent() + session.statistics().frames_dropped() + 1};
  run_frame();
  now += IdrPolicy::least_gap;
  EXPECT_TRUE(frame_is_due()) << "one drop after a good while is answered soon";
}

TEST_F(VisitTest, AnsweringIdrRequestsInQuickSuccessionTakesTurns) {
  greet();
  pose(1, 0.0f);
  ack(run_frame().ticket.frame_id);
  now += IdrPolicy::least_gap;
  const auto next_is_idr = [&] {
    now += 20ms;
    pose(session.statistics().frames_sent() + 1,
         static_cast<float>(session.statistics().frames_sent()));
    const FrameOrder order = run_frame();
    ack(order.ticket.frame_id);
    return order.force_idr;
  };
  EXPECT_FALSE(next_is_idr());
  session.on_message(RequestIdr{}, now);
  EXPECT_TRUE(next_is_idr());
  session.on_message(RequestIdr{}, now);
  now += 250ms - 21ms;
  EXPECT_FALSE(next_is_idr()) << "an IDR was sent a moment ago";
  now += 1ms - 20ms;
  EXPECT_TRUE(next_is_idr()) << "but the request is not forgotten";
  now += IdrPolicy::least_gap;
  EXPECT_FALSE(next_is_idr()) << "and answered once";
}

TEST_F(VisitTest, AStillPictureIsSentAnewForADecoderThatAsks) {
  greet();
  pose(1, 0.0f);
  ack(run_frame().ticket.frame_id);
  for (int i = 0; i < policy.refine_frames; ++i) {
    now += 200ms;
    ack(run_frame().ticket.frame_id);
  }
  ASSERT_FALSE(session.next_frame());
  session.on_message(RequestIdr{}, now);
  ASSERT_TRUE(frame_is_due());
  EXPECT_TRUE(run_frame().force_idr);
}

}  // namespace
}  // namespace catgs
