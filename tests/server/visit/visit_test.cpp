// A Visit with a fake clock and a fake server around it.

#include "tests/server/visit/visit_fixture.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

using test::VisitTest;

TEST_F(VisitTest, WelcomesAfterItsStreamIsOpen) {
  greet();
  ASSERT_EQ(host.opened.size(), 1u);
  EXPECT_EQ(host.opened[0].encoding.size_px, glm::ivec2(640, 360));  // made even
  ASSERT_EQ(host.count<Welcome>(), 1);
  EXPECT_EQ(std::get<Welcome>(host.said.back()).config.codec_string, "avc1.42C01F");
  EXPECT_EQ(session.life().state(), VisitState::live);
  EXPECT_FALSE(session.next_frame()) << "no pose, no frame";
}

TEST_F(VisitTest, ClosesWithoutAHelloInTime) {
  now += 5s - 1ms;
  session.on_tick(now);
  EXPECT_FALSE(host.closed);
  now += 1ms;
  session.on_tick(now);
  EXPECT_EQ(host.closed, CloseCode::policy_violation);
}

TEST_F(VisitTest, RefusesAnOldVersionAndASecondHello) {
  Visit old(policy, host, now);
  old.on_message(Hello{}, now);
  EXPECT_EQ(host.last_error().code, ErrorCode::unsupported_version);
  greet();
  session.on_message(Hello{}, now);
  EXPECT_EQ(host.last_error().code, ErrorCode::bad_message);
  EXPECT_EQ(session.life().state(), VisitState::closed);
}

TEST_F(VisitTest, SaysWhyItIsNotAdmitted) {
  host.admission = ErrorMessage{ErrorCode::unauthorized, "no token", true};
  greet();
  EXPECT_EQ(host.last_error().code, ErrorCode::unauthorized);
  EXPECT_TRUE(host.closed);
  EXPECT_TRUE(host.opened.empty());
}

TEST_F(VisitTest, PauseStopsFramesAndBeginsAnewWithAnIdr) {
  greet();
  pose(1, 0.0f);
  run_frame();  // never acknowledged: the page is hidden
  session.on_message(Pause{true}, now);
  pose(2, 1.0f);
  now += 1s;
  EXPECT_FALSE(session.next_frame());
  session.on_message(Pause{false}, now);
  ASSERT_TRUE(frame_is_due());
  EXPECT_TRUE(run_frame().force_idr);
}

TEST_F(VisitTest, SpeaksAtLeastOnceASecond) {
  greet();
  TimePoint last = now;
  auto said = host.said.size();
  for (int i = 0; i < 20; ++i) {
    now += 250ms;
    session.on_tick(now);
    if (host.said.size() > said) last = now;
    said = host.said.size();
    EXPECT_LT(now - last, 1s);
  }
  EXPECT_LE(host.count<Heartbeat>(), 7);
}

TEST_F(VisitTest, ReportsStatisticsWhileFramesFlow) {
  greet();
  pose(1, 0.0f);
  run_frame();
  session.on_tick(now += 1s);
  ASSERT_EQ(host.count<Stats>(), 1);
  EXPECT_FLOAT_EQ(std::get<Stats>(host.said.back()).fps, 1.0f);
}

TEST_F(VisitTest, OrdersDepthsForClientsThatWantThem) {
  greet();
  pose(1, 0.0f);
  EXPECT_EQ(run_frame().request.depth_cells, glm::ivec2(0));
  Settings settings;
  settings.depths = true;
  session.on_message(settings, now);
  now += 1s;
  pose(2, 0.1f);
  const FrameOrder order = run_frame();
  EXPECT_EQ(order.request.depth_cells, depth_cells_of(order.ticket.size_px));
  PoseSample parallel;
  parallel.pose_id = 3;
  parallel.fov_y_rad = 1.0f;
  parallel.view_height = 4.0f;
  now += 1s;
  session.on_message(parallel, now);
  EXPECT_EQ(run_frame().request.depth_cells, glm::ivec2(0)) << "moved without depths";
}

TEST_F(VisitTest, OrdersBothEyesForHeadsets) {
  greet();
  pose(1, 0.0f);
  const auto next_order = [&] {
    EXPECT_TRUE(frame_is_due()) << "though the head rests";
    const FrameOrder order = run_frame();
    ack(order.ticket.frame_id);
    EXPECT_EQ(order.ticket.stereo, order.request.stereo);
    EXPECT_TRUE(check_request(order.request, PixelFormat::i420).ok());
    return order;
  };
  EXPECT_FALSE(next_order().request.stereo);
  Settings settings;
  settings.size_px = {1280, 640};
  settings.stereo = Stereo{};
  settings.depths = true;
  session.on_message(settings, now += 1s);
  const FrameOrder order = next_order();
  EXPECT_EQ(order.request.stereo, settings.stereo);
  EXPECT_EQ(order.request.camera.size_px, settings.size_px);
  EXPECT_EQ(order.request.depth_cells, depth_cells_of(settings.size_px, 2));
  settings.stereo->front().offset.x = -0.1f;
  session.on_message(settings, now += 1s);
  EXPECT_EQ(next_order().request.stereo, settings.stereo) << "eyes have moved apart";
  settings.stereo.reset();
  session.on_message(settings, now += 1s);
  EXPECT_FALSE(next_order().request.stereo);
}

TEST_F(VisitTest, OrthographicViewsHaveOneEye) {
  Settings settings;
  settings.size_px = {1280, 640};
  settings.stereo = Stereo{};
  greet(settings);
  PoseSample parallel;
  parallel.pose_id = 1;
  parallel.fov_y_rad = 1.0f;
  parallel.view_height = 4.0f;
  session.on_message(parallel, now);
  const FrameOrder order = run_frame();
  EXPECT_FALSE(order.request.stereo);
  EXPECT_FALSE(order.ticket.stereo);
  EXPECT_TRUE(check_request(order.request, PixelFormat::i420).ok());
}

TEST_F(VisitTest, WarnsAnewAfterEverySignOfLifeAndThenReleases) {
  greet();
  const std::function<void()> signs_of_life[] = {
      [&] { pose(1, 0.0f); }, [&] { session.on_message(Settings{}, now); },
      [&] { session.on_message(Pause{true}, now); }, [&] { session.on_message(PosePath{}, now); }};
  int warnings = 0;
  for (const auto& sign_of_life : signs_of_life) {
    sign_of_life();
    now += policy.idle_timeout - policy.idle_warning;
    pose(1, 0.0f);  // the same view: no sign of life
    session.on_tick(now);
    session.on_tick(now + 1s);
    EXPECT_EQ(host.count<ErrorMessage>(), ++warnings);
    EXPECT_EQ(host.last_error().code, ErrorCode::idle_timeout);
    EXPECT_FALSE(host.last_error().fatal);
    now += policy.idle_warning - 1ms;
    session.on_tick(now);
    EXPECT_FALSE(host.closed);
  }
  session.on_tick(now += 1ms);
  EXPECT_TRUE(host.last_error().fatal);
  EXPECT_TRUE(host.closed);
}

TEST_F(VisitTest, EndsWithTheCauseWhereNoEncoderOpens) {
  say_hello();
  StreamOpened refused;
  refused.fault = Fault::encoder_unavailable;
  refused.message = "no more sessions";
  session.on_stream_opened(refused, now);
  EXPECT_EQ(host.last_error().code, ErrorCode::internal) << "nothing is left";
  EXPECT_THAT(host.last_error().message, HasSubstr("no more sessions"));
  EXPECT_EQ(host.closed, CloseCode::try_again_later);
}

TEST_F(VisitTest, EndsWithTheCauseWhereAnEncoderOpensNoMore) {
  greet();
  pose(1, 0.0f);
  FrameResult failed;
  failed.frame.ticket = session.start_frame(now).ticket;
  failed.fault = Fault::encoder_unavailable;
  failed.message = "no memory";
  session.on_frame(std::move(failed), now);
  EXPECT_EQ(host.last_error().code, ErrorCode::internal);
  EXPECT_THAT(host.last_error().message, HasSubstr("no memory"));
}

TEST_F(VisitTest, CountsAFrameOnceItHasLeft) {
  greet();
  pose(1, 0.0f);
  run_frame(false);
  EXPECT_EQ(session.statistics().frames_sent(), 0u) << "it waits for the socket";
  session.statistics().frame_sent(123);
  EXPECT_EQ(session.statistics().frames_sent(), 1u);
  EXPECT_EQ(session.statistics().bytes_sent(), 123u);
}

TEST_F(VisitTest, AFewFailedFramesEndItWithTheirCause) {
  greet();
  for (int i = 0; i < 3; ++i) {
    ASSERT_FALSE(host.closed) << "after " << i;
    pose(static_cast<std::uint64_t>(i) + 1, static_cast<float>(i));
    now += 1s;
    ASSERT_TRUE(frame_is_due());
    session.start_frame(now);
    FrameResult failed;
    failed.message = "blend: out of memory";
    session.on_frame(std::move(failed), now);
  }
  EXPECT_EQ(host.last_error().code, ErrorCode::render_failed);
  EXPECT_THAT(host.last_error().message, HasSubstr("out of memory"));
  EXPECT_TRUE(host.closed);
}

}  // namespace
}  // namespace catgs
