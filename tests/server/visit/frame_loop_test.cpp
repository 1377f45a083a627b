// When a frame is due and of what, with a client that only acknowledges.

#include "server/visit/frame_loop.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

class FrameLoopTest : public testing::Test {
 protected:
  FrameLoopTest() {
    flow.set_request({{640, 360}, 60, 8000});
    SceneFacts scene;
    scene.about.background_rgb = 0xff0000;
    loop.enter_scene(scene);
  }
  static PoseSample sample(std::uint64_t id, float x, bool at_rest = false) {
    PoseSample sample;
    sample.pose_id = id;
    sample.world_from_camera.position.x = x;
    sample.fov_y_rad = 1.0f;
    sample.at_rest = at_rest;
    return sample;
  }
  bool pose(std::uint64_t id, float x, bool at_rest = false) {
    return loop.pose_arrived(sample(id, x, at_rest), now);
  }
  bool has_next() const { return loop.next(idr, shown_px == still_px).has_value(); }
  bool is_due() const {
    const auto candidate = loop.next(idr, shown_px == still_px);
    return candidate && candidate->ready <= now;
  }
  FrameOrder start() {
    FrameOrder order;
    order.ticket.still = loop.rests(now);
    order.ticket.codec = codec;
    order.encoding.size_px = order.ticket.still ? still_px : moving_px;
    order.force_idr = std::exchange(shown_px, order.encoding.size_px) != shown_px;
    loop.start(order, now);
    return order;
  }
  bool made(const FrameOrder& order) {
    FrameResult result;
    result.frame.ticket = order.ticket;
    result.frame.ticket.render = result.frame.ticket.encode = {now, now};
    result.frame.bitstream.resize(order.ticket.still ? still_bytes : 100);
    result.sharp = sharp;
    result.stats.settled = settled;
    return loop.made(result, now);
  }
  void ack(const FrameOrder& order, std::uint32_t pose_age_us = 0) {
    Ack message;
    message.frame_id = order.ticket.frame_id;
    message.presented_us = 1;
    message.pose_age_us = pose_age_us;
    loop.acknowledged(message, now);
  }
  /// Starts, makes and shows one.
  FrameOrder run(std::uint32_t pose_age_us = 0) {
    const FrameOrder order = start();
    made(order);
    ack(order, pose_age_us);
    return order;
  }
  void next_pose(bool at_rest = false) {
    ++poses;
    pose(poses, static_cast<float>(poses), at_rest);
  }
  FrameOrder moved() {
    now += 17ms;
    next_pose();
    return run();
  }
  FrameOrder rested() {
    now += policy.still_after;
    EXPECT_TRUE(is_due());
    return run();
  }

  Codec codec = Codec::h264;
  glm::ivec2 moving_px{640, 360};
  glm::ivec2 still_px{640, 360};
  glm::ivec2 shown_px{0};
  bool sharp = false;   // what the encoder says of its pictures
  bool settled = true;  // all pages of the scene are there that the picture needs
  std::size_t still_bytes = 100;
  std::uint64_t poses = 0;
  TimePoint now = TimePoint{} + 1h;
  VisitPolicy policy;
  FlowControl flow;
  IdrPolicy idr;
  FrameLoop loop{policy, flow};
};

TEST_F(FrameLoopTest, RendersOnDemandAndRefinesAStillPicture) {
  EXPECT_FALSE(has_next()) << "no pose, no frame";
  EXPECT_TRUE(pose(1, 0.0f));
  ASSERT_TRUE(is_due());
  FrameOrder order = run();
  EXPECT_FALSE(order.ticket.refined);
  EXPECT_EQ(order.ticket.pose_id, 1u);
  EXPECT_EQ(order.request.background, glm::vec3(1.0f, 0.0f, 0.0f)) << "of the scene";

  EXPECT_FALSE(pose(2, 0.0f)) << "the same view: nothing to render";
  now += 50ms;
  EXPECT_FALSE(is_due()) << "motion may go on";
  int refinements = 0;
  for (int i = 0; i < 200; ++i) {
    now += 17ms;
    if (!is_due()) continue;
    order = run();
    EXPECT_TRUE(order.ticket.refined);
    ++refinements;
  }
  EXPECT_EQ(refinements, policy.refine_frames);

  pose(3, 1.0f);
  ASSERT_TRUE(is_due());
  EXPECT_FALSE(run().ticket.refined);
}

TEST_F(FrameLoopTest, KeepsTheNominalRateAndUsesTheNewestPose) {
  int frames = 0;
  for (std::uint64_t ms = 1; ms <= 1000; ++ms) {
    now += 1ms;
    pose(ms, 0.01f * static_cast<float>(ms));
    if (!is_due()) continue;
    EXPECT_EQ(run().ticket.pose_id, ms);
    ++frames;
  }
  EXPECT_NEAR(frames, 60, 1);
}

// A camera that rests has a new picture as long as pages come in. Its still waits for the last.
TEST_F(FrameLoopTest, DrawsOnUntilThePictureHasItsDetail) {
  settled = false;
  moved();
  for (int i = 0; i < 30; ++i) {
    now += 17ms;
    ASSERT_TRUE(is_due());
    EXPECT_FALSE(run().ticket.still);
  }
  settled = true;
  now += 17ms;
  EXPECT_FALSE(run().ticket.still);
  now += 17ms;
  ASSERT_TRUE(is_due());
  const FrameOrder still = run();
  EXPECT_TRUE(still.ticket.still);
  EXPECT_EQ(still.request.detail_px, policy.detail_px);
}

TEST_F(FrameLoopTest, IgnoresAPoseThatWasOvertaken) {
  pose(5, 1.0f);
  EXPECT_FALSE(pose(4, 2.0f));
  EXPECT_EQ(run().ticket.pose_id, 5u);
}

TEST_F(FrameLoopTest, NeedsCredit) {
  pose(1, 0.0f);
  const FrameOrder first = start();
  made(first);
  pose(2, 1.0f);
  now += 1s;
  EXPECT_FALSE(has_next()) << "one frame in flight, and no round trip measured yet";
  ack(first);
  EXPECT_TRUE(is_due());
}

TEST_F(FrameLoopTest, TellsTheEncoderItsRealRate) {
  int real_fps = 0;
  const auto run_at = [&](std::chrono::milliseconds interval, int count) {
    for (int i = 0; i < count; ++i) {
      now += interval;
      next_pose();
      real_fps = run().real_fps;
    }
  };
  run_at(100ms, 60);
  EXPECT_EQ(real_fps, 10);
  EXPECT_NEAR(std::chrono::duration<double>(loop.interval()).count(), 0.1, 0.001);
  run_at(5s, 1);
  EXPECT_EQ(real_fps, 10) << "a pause is no slow frame";
  run_at(20ms, 60);
  EXPECT_EQ(real_fps, 50);
}

TEST_F(FrameLoopTest, AFrameOfALostConnectionIsDropped) {
  pose(1, 0.0f);
  const FrameOrder old = start();
  loop.forget_started();
  EXPECT_FALSE(made(old));
  EXPECT_EQ(flow.credit().in_flight(), 0);
  pose(2, 1.0f);
  EXPECT_TRUE(made(start()));
}

TEST_F(FrameLoopTest, GivesUpAfterThreeFailuresInARow) {
  for (int i = 0; i < 3; ++i) {
    moved();  // ends the row
    EXPECT_FALSE(loop.failed_again());
    EXPECT_FALSE(loop.failed_again());
  }
  EXPECT_TRUE(loop.failed_again());
}

TEST_F(FrameLoopTest, AFrameThatFailedIsDrawnAgain) {
  pose(1, 0.0f);
  start();
  EXPECT_FALSE(is_due());
  loop.failed();
  now += 17ms;
  EXPECT_TRUE(is_due());
}

TEST_F(FrameLoopTest, TheClientsClockMayJump) {
  constexpr std::int64_t hour_us = 3'600'000'000;
  for (const std::int64_t jump_us : {std::int64_t{0}, -hour_us, 2 * hour_us, -100 * hour_us}) {
    for (int step = 0; step < 30; ++step) {
      now += 17ms;
      ++poses;
      PoseSample next = sample(poses, 0.01f * static_cast<float>(poses));
      next.client_time_us = 10 * hour_us + jump_us + 17'000 * step;
      loop.pose_arrived(next, now);
      ASSERT_TRUE(is_due()) << jump_us;
      const FrameOrder order = run();
      EXPECT_EQ(order.ticket.pose_id, poses);
      EXPECT_NEAR(order.ticket.render_pose.position.x, next.world_from_camera.position.x, 0.1f)
          << "no forecast crosses the jump";
    }
  }
}

class AimTest : public FrameLoopTest {
 protected:
  /// Samples of the client's clock, 1/60 s apart, 0.1 further along x each, all shown that late.
  FrameOrder walk(std::uint64_t count, std::chrono::microseconds pose_to_photon) {
    FrameOrder order;
    for (std::uint64_t i = 0; i < count; ++i) {
      sample_.pose_id += 1;
      sample_.client_time_us += 16'667;
      sample_.world_from_camera.position.x += 0.1f;
      now += 17ms;
      loop.pose_arrived(sample_, now);
      order = run(static_cast<std::uint32_t>(pose_to_photon.count()));
    }
    return order;
  }
  /// How far ahead of its pose a frame was rendered, in steps of the walk.
  [[nodiscard]] float steps_ahead(const FrameOrder& order) const {
    return (order.ticket.render_pose.position.x - sample_.world_from_camera.position.x) / 0.1f;
  }

  PoseSample sample_ = sample(0, 0.0f);
};

TEST_F(AimTest, RendersWhereTheCameraWillBeWhenThePictureIsSeen) {
  EXPECT_NEAR(steps_ahead(walk(60, 0ms)), 0.0f, 0.01f);
  EXPECT_NEAR(steps_ahead(walk(120, 50ms)), 3.0f, 0.2f);
  EXPECT_NEAR(steps_ahead(walk(120, 1s)), 6.0f, 0.4f) << "100 ms at most";
}

TEST_F(AimTest, RendersThePoseItselfWithoutForecasts) {
  policy.forecasts = false;
  EXPECT_NEAR(steps_ahead(walk(60, 50ms)), 0.0f, 0.01f);
}

TEST_F(AimTest, APictureThatStaysIsOfThePoseItself) {
  const FrameOrder moving = walk(60, 50ms);
  ASSERT_GT(steps_ahead(moving), 1.0f);
  EXPECT_FALSE(is_due()) << "the camera may still move";
  now += policy.still_after + 17ms;
  ASSERT_TRUE(is_due());
  const FrameOrder order = run(50'000);
  EXPECT_FALSE(order.ticket.refined);
  EXPECT_EQ(steps_ahead(order), 0.0f);
  now += 70ms;
  ASSERT_TRUE(is_due());
  EXPECT_TRUE(run().ticket.refined);
}

/// Moving pictures of 426x240, whatever the reason, and still ones of 1280x720.
class RestTest : public FrameLoopTest {
 protected:
  RestTest() {
    moving_px = {426, 240};
    still_px = {1280, 720};
    flow.set_request({moving_px, 60, 8000});
  }
};

TEST_F(RestTest, EndsWhenTheEncoderFindsItsPictureSharp) {
  sharp = true;
  moved();
  EXPECT_EQ(rested().ticket.size_px, still_px) << "sharp in its size only";
  now += 10s;
  EXPECT_FALSE(has_next());
}

TEST_F(FrameLoopTest, ASharpStillOfTheSizeOfMotionIsNotRefined) {
  moved();
  sharp = true;
  EXPECT_TRUE(rested().ticket.still);
  now += 10s;
  EXPECT_FALSE(has_next());
}

TEST_F(RestTest, PosesThatComeSlowlyAreNone) {
  for (int i = 0; i < 40; ++i) {
    next_pose();
    for (int ms = 0; ms < 200; ++ms, now += 1ms) {
      if (!is_due()) continue;
      const FrameOrder order = run();
      if (i > 10) {
        EXPECT_EQ(order.ticket.size_px, moving_px);
      }
    }
  }
  now += 1s;
  ASSERT_TRUE(is_due());
  EXPECT_EQ(run().ticket.size_px, still_px);
}

TEST_F(RestTest, BeginsAtOnceWhereTheClientSaysThatNothingMoves) {
  for (int i = 0; i < 5; ++i) moved();
  now += 17ms;
  pose(poses, static_cast<float>(poses), true);
  ASSERT_TRUE(is_due());
  const FrameOrder still = run();
  EXPECT_TRUE(still.ticket.still);
  EXPECT_EQ(still.ticket.size_px, still_px);
  EXPECT_FALSE(moved().ticket.still);
  now += 99ms;
  EXPECT_FALSE(is_due()) << "what was said is over";
  now += 1ms;
  EXPECT_TRUE(is_due());
}

TEST_F(RestTest, BeginsWithAPoseThatNothingMovesEvenIfTheOneBeforeWasHeldUp) {
  for (int i = 0; i < 5; ++i) moved();
  now += 17ms;
  next_pose(true);
  EXPECT_TRUE(run().ticket.still);
}

TEST_F(RestTest, ClaimsOfRestWithEveryPoseGiveNoMoreStills) {
  int stills = 0;
  const TimePoint begin = now;
  while (now - begin < 2s) {
    now += 20ms;
    next_pose(true);
    if (is_due()) stills += run().ticket.still ? 1 : 0;
  }
  EXPECT_GT(stills, 15);
  EXPECT_LE(stills, 20);
}

TEST_F(RestTest, ItsPicturesTakeAShareOfTheLinkThatKeepsQueuesShort) {
  for (int i = 0; i < 30; ++i) moved();
  still_bytes = 60'000;
  const FrameOrder still = rested();
  EXPECT_EQ(still.real_fps, 13);
  EXPECT_LE(still.bitrate_kbps, flow.bitrate_kbps());
  EXPECT_LE(still.bitrate_kbps / still.real_fps, 1.5e-3 * 1280 * 720) << "enough is enough";
  const auto passing = flow.time_on_link(still_bytes, now);
  now += passing;
  EXPECT_FALSE(is_due()) << "the link has only just carried it";
  now += passing / 4;
  ASSERT_TRUE(is_due()) << "and what stood in front of it";
  EXPECT_EQ(run().real_fps, 13);
}

TEST_F(RestTest, JpegsGrowUntilTheyAreSharp) {
  codec = Codec::mjpeg;
  moved();
  EXPECT_EQ(rested().real_fps, 13);
  for (const int fps : {6, 4}) {
    now += 300ms;
    ASSERT_TRUE(is_due());
    EXPECT_EQ(run().real_fps, fps);
  }
  now += 10s;
  EXPECT_FALSE(has_next());
}

TEST_F(FrameLoopTest, AnotherClipBoxIsAnotherPicture) {
  moved();
  rested();
  while (has_next()) rested();
  const ClipBox plane = clip_plane({0, 1, 0}, 2);
  loop.clip(plane, now);
  now += 17ms;
  ASSERT_TRUE(is_due());
  EXPECT_EQ(run().request.camera.clip, plane);
  const FrameOrder still = rested();
  EXPECT_TRUE(still.ticket.still);
  EXPECT_EQ(still.request.camera.clip, plane);
  while (has_next()) rested();
  loop.clip(plane, now);
  EXPECT_FALSE(has_next()) << "the same one";
  loop.enter_scene({});
  pose(++poses, 1.0f);
  EXPECT_EQ(run().request.camera.clip, ClipBox{});
}

TEST_F(FrameLoopTest, OrthographicPosesGiveOrthographicPictures) {
  PoseSample plan = sample(1, 0.0f);
  plan.view_height = 18.0f;
  loop.pose_arrived(plan, now);
  const FrameOrder order = run();
  EXPECT_TRUE(order.request.camera.orthographic);
  EXPECT_EQ(order.request.camera.focal_px.y, 360.0f / 18.0f);
  EXPECT_EQ(order.ticket.view_height, 18.0f);
  plan.pose_id = 2;
  plan.view_height = 9.0f;
  loop.pose_arrived(plan, now += 17ms);
  EXPECT_TRUE(is_due()) << "another scale";
  run();
  loop.pose_arrived(sample(3, 0.0f), now += 17ms);
  EXPECT_TRUE(is_due());
  EXPECT_FALSE(run().request.camera.orthographic);
}

}  // namespace
}  // namespace catgs
