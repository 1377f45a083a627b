// The picture that stays when the camera rests.

#include "tests/server/session/session_fixture.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

class StillTest : public test::SessionTest {
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
  EXPECT_FALSE(still.request.forecast);
  ASSERT_EQ(host.count<StreamConfig>(), 1);
  EXPECT_EQ(session.config().size_px, glm::ivec2(1280, 720));
  EXPECT_EQ(session.config().fps, policy.default_fps) << "that of moving pictures";

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
  EXPECT_EQ(session.config().size_px, glm::ivec2(426, 240));
  EXPECT_FALSE(moved().force_idr);
}

TEST_F(StillTest, EndsWhenTheEncoderFindsItSharp) {
  greet(small_in_motion());
  sharp = true;
  moved();
  EXPECT_EQ(rested().ticket.size_px, glm::ivec2(1280, 720)) << "sharp in its size only";
  now += 10s;
  EXPECT_FALSE(session.next_frame());
}

// The first picture in the stream of motion has no more room than motion had.
TEST_F(StillTest, OfTheSizeOfMotionIsRefinedAgainWhateverTheEncoderFinds) {
  greet({});
  sharp = true;
  moved();
  EXPECT_TRUE(rested().ticket.still);
  now += 100ms;
  ASSERT_TRUE(frame_is_due());
  EXPECT_TRUE(shown().ticket.refined);
  now += 10s;
  EXPECT_FALSE(session.next_frame());
}

TEST_F(StillTest, TheLadderAndWishesForMotionLeaveItAlone) {
  greet(small_in_motion());
  sharp = true;
  moved();
  rested();
  Settings larger = small_in_motion();
  larger.size_px = {640, 360};
  session.on_message(larger, now);
  session.use_effort({.preset = 0, .threads = 2});
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

TEST_F(StillTest, IsNoSmallerThanMotionAndWithinTheServersLimit) {
  policy.max_pixels = 640 * 360;
  Settings settings;
  settings.size_px = {426, 240};
  settings.still_size_px = {3840, 2160};
  EXPECT_EQ(still_size_within(policy, settings, {100, 100}), glm::ivec2(640, 360));
  settings.still_size_px = {64, 36};
  EXPECT_EQ(still_size_within(policy, settings, {100, 100}), glm::ivec2(426, 240));
  settings.still_size_px = {640, 360};
  settings.fixed_quality = true;
  EXPECT_EQ(still_size_within(policy, settings, {100, 100}), glm::ivec2(426, 240));
}

TEST_F(StillTest, WhatCannotBeMadeSoLargeStaysAsInMotion) {
  greet(small_in_motion());
  moved();
  now += policy.still_after;
  ASSERT_TRUE(frame_is_due());
  FrameResult failed;
  failed.frame.ticket = session.start_frame(now).ticket;
  failed.fault = Fault::encoder_unavailable;
  session.on_frame(std::move(failed), now);
  EXPECT_FALSE(host.closed);
  now += 300ms;
  ASSERT_TRUE(frame_is_due());
  const FrameOrder order = shown();
  EXPECT_EQ(order.ticket.size_px, glm::ivec2(426, 240));
  EXPECT_TRUE(order.force_idr);
  moved();
  EXPECT_EQ(rested().ticket.size_px, glm::ivec2(426, 240)) << "nor is it tried each time";
}

TEST_F(StillTest, AnEncoderThatFailsAtALargerOneMakesWayAsInMotion) {
  greet(small_in_motion());
  moved();
  now += policy.still_after;
  ASSERT_TRUE(frame_is_due());
  host.other = EncoderChoice{EncoderKind::x264, Codec::h264, "libx264"};
  FrameResult failed;
  failed.frame.ticket = session.start_frame(now).ticket;
  failed.fault = Fault::encoder_failed;
  session.on_frame(std::move(failed), now);
  ASSERT_FALSE(host.opened.empty());
  EXPECT_EQ(host.opened.back().encoder, EncoderKind::x264);
  session.on_stream_opened({true, {}, Codec::h264, "avc1.42c020", "libx264"}, now);
  now += 300ms;
  ASSERT_TRUE(frame_is_due());
  EXPECT_EQ(shown().ticket.size_px, glm::ivec2(1280, 720)) << "the other one may manage it";
}

TEST_F(StillTest, PosesThatComeSlowlyAreNoRest) {
  greet(small_in_motion());
  for (int i = 0; i < 40; ++i) {
    ++poses_;
    pose(poses_, static_cast<float>(poses_));
    for (int ms = 0; ms < 200; ++ms, now += 1ms) {
      if (!frame_is_due()) continue;
      const FrameOrder order = shown();
      if (i > 10) {
        EXPECT_EQ(order.ticket.size_px, glm::ivec2(426, 240));
      }
    }
  }
  now += 1s;
  ASSERT_TRUE(frame_is_due());
  EXPECT_EQ(shown().ticket.size_px, glm::ivec2(1280, 720));
}

TEST_F(StillTest, ComesAtOnceWhereTheClientSaysThatNothingMoves) {
  greet(small_in_motion());
  for (int i = 0; i < 5; ++i) moved();
  now += 17ms;
  pose(poses_, static_cast<float>(poses_), true);
  ASSERT_TRUE(frame_is_due());
  const FrameOrder still = shown();
  EXPECT_TRUE(still.ticket.still);
  EXPECT_EQ(still.ticket.size_px, glm::ivec2(1280, 720));
  const FrameOrder moving = moved();
  EXPECT_FALSE(moving.ticket.still);
  now += 99ms;
  EXPECT_FALSE(frame_is_due()) << "what was said is over";
  now += 1ms;
  EXPECT_TRUE(frame_is_due());
}

TEST_F(StillTest, APoseThatNothingMovesIsAStillEvenIfTheOneBeforeWasHeldUp) {
  greet(small_in_motion());
  for (int i = 0; i < 5; ++i) moved();
  now += 17ms;
  ++poses_;
  pose(poses_, static_cast<float>(poses_), true);
  EXPECT_TRUE(run_frame().ticket.still);
}

TEST_F(StillTest, WhoSaysWithEveryPoseThatNothingMovesGetsNoMoreOfThem) {
  greet(small_in_motion());
  int stills = 0;
  const TimePoint begin = now;
  while (now - begin < 2s) {
    now += 20ms;
    ++poses_;
    pose(poses_, static_cast<float>(poses_), true);
    if (frame_is_due()) stills += shown().ticket.still ? 1 : 0;
  }
  EXPECT_GT(stills, 15);
  EXPECT_LE(stills, 20);
}

TEST_F(StillTest, TakesAShareOfTheLinkThatKeepsQueuesShort) {
  greet(small_in_motion());
  for (int i = 0; i < 30; ++i) moved();
  still_bytes = 60'000;
  const FrameOrder still = rested();
  EXPECT_EQ(still.real_fps, 13);
  EXPECT_LE(still.bitrate_kbps, session.flow().bitrate_kbps());
  EXPECT_LE(still.bitrate_kbps / still.real_fps, 1.5e-3 * 1280 * 720) << "enough is enough";
  const auto passing = session.flow().time_on_link(still_bytes, now);
  now += passing;
  EXPECT_FALSE(frame_is_due()) << "the link has only just carried it";
  now += passing / 4;
  ASSERT_TRUE(frame_is_due()) << "and what stood in front of it";
  EXPECT_EQ(shown().real_fps, 13);
}

TEST_F(StillTest, WhatSharpensItGoesOnInItsStream) {
  greet(small_in_motion());
  session.use_effort({.preset = 0, .threads = 2});
  moved();
  const FrameOrder still = rested();
  EXPECT_EQ(still.encoding.x264_preset, "superfast") << "less effort would cost more bytes";
  session.use_effort({.preset = 2, .threads = 1});
  now += 70ms;
  ASSERT_TRUE(frame_is_due());
  const FrameOrder refinement = shown();
  EXPECT_TRUE(refinement.ticket.refined);
  EXPECT_FALSE(refinement.force_idr);
  EXPECT_EQ(refinement.encoding, still.encoding);
  EXPECT_EQ(moved().encoding.threads, 1);
}

TEST_F(StillTest, JpegsGrowUntilTheyAreSharp) {
  host.admission = Admission{std::get<Admission>(host.admission).scene,
                             {EncoderKind::jpeg, Codec::mjpeg, "mjpeg"}};
  say_hello(small_in_motion());
  session.on_stream_opened({true, "", Codec::mjpeg, "", "mjpeg"}, now);
  moved();
  EXPECT_EQ(rested().real_fps, 13);
  for (const int fps : {6, 4}) {
    now += 300ms;
    ASSERT_TRUE(frame_is_due());
    EXPECT_EQ(shown().real_fps, fps);
  }
  now += 10s;
  EXPECT_FALSE(session.next_frame());
}

}  // namespace
}  // namespace catgs
