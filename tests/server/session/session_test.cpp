// A Session with a fake clock and a fake server around it.

#include "tests/server/session/session_fixture.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;
using test::SessionTest;
using testing::HasSubstr;

TEST_F(SessionTest, WelcomesAfterItsStreamIsOpen) {
  greet();
  ASSERT_EQ(host.opened.size(), 1u);
  EXPECT_EQ(host.opened[0].encoding.size_px, glm::ivec2(640, 360));  // made even
  ASSERT_EQ(host.count<Welcome>(), 1);
  EXPECT_EQ(std::get<Welcome>(host.said.back()).config.codec_string, "avc1.42C01F");
  EXPECT_EQ(session.state(), Session::State::live);
  EXPECT_FALSE(session.next_frame()) << "no pose, no frame";
}

TEST_F(SessionTest, ClosesWithoutAHelloInTime) {
  now += 5s - 1ms;
  session.on_tick(now);
  EXPECT_FALSE(host.closed);
  now += 1ms;
  session.on_tick(now);
  EXPECT_EQ(host.closed, CloseCode::policy_violation);
}

TEST_F(SessionTest, WishesEndAtThePolicy) {
  const auto wish = [this](glm::ivec2 size_px, int kbps) {
    return wish_within(policy, {.size_px = size_px, .max_bitrate_kbps = kbps}, {640, 360});
  };
  EXPECT_EQ(wish({3840, 2160}, 0).size_px, glm::ivec2(3840, 2160));
  EXPECT_EQ(wish({3842, 2160}, 0).size_px, glm::ivec2(3840, 2158));
  EXPECT_EQ(still_size_within(policy, {.still_size_px = {8192, 4608}}, {640, 360}),
            glm::ivec2(3840, 2160));
  EXPECT_EQ(wish({}, 99'999).bitrate_kbps, 99'999);
  EXPECT_EQ(wish({}, 100'001).bitrate_kbps, 100'000);
}

TEST_F(SessionTest, RefusesAnOldVersionAndASecondHello) {
  Session old("old", policy, host, now);
  old.on_message(Hello{}, now);
  EXPECT_EQ(host.last_error().code, ErrorCode::unsupported_version);
  greet();
  session.on_message(Hello{}, now);
  EXPECT_EQ(host.last_error().code, ErrorCode::bad_message);
  EXPECT_EQ(session.state(), Session::State::closed);
}

TEST_F(SessionTest, SaysWhyItIsNotAdmitted) {
  host.admission = ErrorMessage{ErrorCode::unauthorized, "no token", true};
  greet();
  EXPECT_EQ(host.last_error().code, ErrorCode::unauthorized);
  EXPECT_TRUE(host.closed);
  EXPECT_TRUE(host.opened.empty());
}

TEST_F(SessionTest, RendersOnDemandAndRefinesAStillPicture) {
  greet();
  pose(1, 0.0f);
  ASSERT_TRUE(frame_is_due());
  FrameOrder order = run_frame();
  EXPECT_TRUE(order.force_idr);
  EXPECT_FALSE(order.ticket.refined);
  EXPECT_EQ(order.ticket.pose_id, 1u);
  ack(order.ticket.frame_id);

  pose(2, 0.0f);  // the same view: nothing to render
  now += 50ms;
  EXPECT_FALSE(frame_is_due()) << "motion may go on";
  int refinements = 0;
  for (int i = 0; i < 200; ++i) {
    now += 17ms;
    if (!frame_is_due()) continue;
    order = run_frame();
    EXPECT_TRUE(order.ticket.refined);
    EXPECT_FALSE(order.force_idr);
    ack(order.ticket.frame_id);
    ++refinements;
  }
  EXPECT_EQ(refinements, policy.refine_frames);

  pose(3, 1.0f);
  ASSERT_TRUE(frame_is_due());
  EXPECT_FALSE(run_frame().ticket.refined);
}

TEST_F(SessionTest, KeepsTheNominalRateAndUsesTheNewestPose) {
  greet();
  int frames = 0;
  for (std::uint64_t ms = 1; ms <= 1000; ++ms) {
    now += 1ms;
    pose(ms, 0.01f * static_cast<float>(ms));
    if (!frame_is_due()) continue;
    const FrameOrder order = run_frame();
    EXPECT_EQ(order.ticket.pose_id, ms);
    ack(order.ticket.frame_id);
    ++frames;
  }
  EXPECT_GE(frames, policy.default_fps - 1);
  EXPECT_LE(frames, policy.default_fps + 1);
}

TEST_F(SessionTest, IgnoresAPoseThatWasOvertaken) {
  greet();
  pose(5, 1.0f);
  pose(4, 2.0f);
  EXPECT_EQ(run_frame().ticket.pose_id, 5u);
}

TEST_F(SessionTest, NeedsCredit) {
  greet();
  pose(1, 0.0f);
  const std::uint64_t first = run_frame().ticket.frame_id;
  pose(2, 1.0f);
  now += 1s;
  EXPECT_FALSE(session.next_frame()) << "one frame in flight, and no round trip measured yet";
  ack(first);
  EXPECT_TRUE(frame_is_due());
}

TEST_F(SessionTest, CountsAFrameOnceItHasLeft) {
  greet();
  pose(1, 0.0f);
  const FrameOrder order = session.start_frame(now);
  FrameResult result;
  result.ok = true;
  result.frame.ticket = order.ticket;
  session.on_frame(std::move(result), now);
  EXPECT_EQ(session.frames_sent(), 0u) << "it waits for the socket";
  session.on_frame_sent(order.ticket, 123);
  EXPECT_EQ(session.frames_sent(), 1u);
  EXPECT_EQ(session.bytes_sent(), 123u);
}

TEST_F(SessionTest, PauseStopsFramesAndBeginsAnewWithAnIdr) {
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

TEST_F(SessionTest, SettingsHoldForTheNextFrame) {
  greet();
  pose(1, 0.0f);
  const FrameOrder order = session.start_frame(now);
  Settings settings;
  settings.size_px = {320, 180};
  settings.max_fps = 30;
  session.on_message(settings, now);
  finish(order);
  EXPECT_EQ(host.count<StreamConfig>(), 0) << "that frame was of the old size";
  now += 20ms;
  ack(order.ticket.frame_id);
  pose(2, 1.0f);
  ASSERT_TRUE(frame_is_due());
  const FrameOrder next = run_frame();
  EXPECT_EQ(next.encoding.size_px, glm::ivec2(320, 180));
  EXPECT_EQ(next.ticket.size_px, glm::ivec2(320, 180));
  EXPECT_EQ(next.encoding.fps, 30);
  EXPECT_TRUE(next.force_idr);
  ASSERT_EQ(host.count<StreamConfig>(), 1);
  EXPECT_EQ(std::get<StreamConfig>(host.said.back()).size_px, glm::ivec2(320, 180));
  EXPECT_EQ(host.opened.size(), 1u) << "its view, with its caches, goes on";
}

// Each combination would be another encoder, and an IDR.
TEST_F(SessionTest, SettingsThatAlternateQuicklyAreFollowedFourTimesASecond) {
  greet();
  int encoders = 0;
  std::optional<EncoderSettings> last;
  Settings settings;
  for (std::uint64_t ms = 1; ms <= 1000; ++ms) {
    now += 1ms;
    settings.size_px = {320 + 2 * (static_cast<int>(ms) % 100), 180};
    session.on_message(settings, now);
    if (ms % 250 == 0) session.on_tick(now);
    pose(ms, 0.01f * static_cast<float>(ms));
    if (!frame_is_due()) continue;
    const FrameOrder order = run_frame();
    ack(order.ticket.frame_id);
    if (std::exchange(last, order.encoding) != order.encoding) ++encoders;
  }
  EXPECT_LE(encoders, 6);
  EXPECT_GE(encoders, 3);
  now += 250ms;
  session.on_tick(now);
  pose(2000, 20.0f);
  EXPECT_EQ(run_frame().encoding.size_px, settings.size_px) << "the last wish is not forgotten";
}

TEST_F(SessionTest, SpeaksAtLeastOnceASecond) {
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

TEST_F(SessionTest, TellsTheEncoderItsRealRate) {
  greet();
  int real_fps = 0;
  const auto run_at = [&](std::chrono::milliseconds interval, int count) {
    for (int i = 0; i < count; ++i) {
      now += interval;
      pose(session.frames_sent() + 1, static_cast<float>(session.frames_sent()));
      real_fps = run_frame().real_fps;
      ack(session.frames_sent());
    }
  };
  run_at(100ms, 60);
  EXPECT_EQ(real_fps, 10);
  run_at(5s, 1);
  EXPECT_EQ(real_fps, 10) << "a pause is no slow frame";
  run_at(20ms, 60);
  EXPECT_EQ(real_fps, 50);
}

TEST_F(SessionTest, ReportsStatisticsWhileFramesFlow) {
  greet();
  pose(1, 0.0f);
  run_frame();
  now += 1s;
  session.on_tick(now);
  ASSERT_EQ(host.count<Stats>(), 1);
  const auto& stats = std::get<Stats>(host.said.back());
  EXPECT_FLOAT_EQ(stats.fps, 1.0f);
  EXPECT_FLOAT_EQ(stats.bitrate_kbps, 0.8f);
}

TEST_F(SessionTest, WarnsAndThenReleasesAnIdleSession) {
  greet();
  pose(1, 0.0f);
  now += policy.idle_timeout - policy.idle_warning;
  pose(2, 0.0f);  // the same view: not alive
  session.on_tick(now);
  EXPECT_EQ(host.last_error().code, ErrorCode::idle_timeout);
  EXPECT_FALSE(host.last_error().fatal);
  EXPECT_THAT(host.last_error().message, HasSubstr("30 s"));
  EXPECT_FALSE(host.closed);
  now += policy.idle_warning;
  session.on_tick(now);
  EXPECT_TRUE(host.last_error().fatal);
  EXPECT_TRUE(host.closed);
}

TEST_F(SessionTest, WarnsAnewAfterEverySignOfLife) {
  greet();
  const auto warnings = [&] { return host.count<ErrorMessage>(); };
  const auto sign_of_life = [&](int i) {
    if (i == 0) pose(1, 0.0f);
    if (i == 1) session.on_message(Settings{}, now);
    if (i == 2) session.on_message(Pause{true}, now);
    if (i == 3) session.on_message(PosePath{}, now);
  };
  for (int i = 0; i < 4; ++i) {
    sign_of_life(i);
    now += policy.idle_timeout - policy.idle_warning;
    session.on_tick(now);
    session.on_tick(now + 1s);
    EXPECT_EQ(warnings(), i + 1);
    now += policy.idle_warning - 1ms;
    session.on_tick(now);
    EXPECT_FALSE(host.closed);
  }
}

TEST_F(SessionTest, GoesOnWithAnotherEncoderWhereTheDriverOpensNoMore) {
  host.other = EncoderChoice{EncoderKind::x264, Codec::h264, "libx264"};
  host.admission = Admission{std::get<Admission>(host.admission).scene,
                             {EncoderKind::nvenc, Codec::h264, "h264_nvenc"}};
  Hello hello;
  hello.version = 1;
  hello.viewport_px = {640, 360};
  session.on_message(hello, now);
  StreamOpened refused;
  refused.fault = Fault::encoder_unavailable;
  session.on_stream_opened(refused, now);
  ASSERT_EQ(host.opened.size(), 2u);
  EXPECT_EQ(host.opened[1].encoder, EncoderKind::x264);
  open_stream();
  ASSERT_EQ(host.count<Welcome>(), 1);
  EXPECT_EQ(std::get<Welcome>(host.said.back()).config.encoder, "libx264");

  pose(1, 0.0f);
  const FrameOrder order = session.start_frame(now);
  FrameResult failed;
  failed.frame.ticket = order.ticket;
  failed.fault = Fault::encoder_unavailable;
  failed.message = "no memory";
  session.on_frame(std::move(failed), now);
  EXPECT_EQ(host.last_error().code, ErrorCode::internal) << "nothing is left";
  EXPECT_THAT(host.last_error().message, HasSubstr("no memory"));
}

TEST_F(SessionTest, AnotherEffortOpensTheEncoderAnewWithAnIdr) {
  greet();
  EXPECT_EQ(host.opened[0].encoding.x264_preset, "superfast");
  pose(1, 0.0f);
  ack(run_frame().ticket.frame_id);
  session.use_effort({.preset = 0, .threads = 4});
  now += 20ms;
  EXPECT_FALSE(frame_is_due()) << "it makes no picture by itself";
  pose(2, 1.0f);
  ASSERT_TRUE(frame_is_due());
  const FrameOrder order = run_frame();
  EXPECT_EQ(order.encoding.x264_preset, "ultrafast");
  EXPECT_EQ(order.encoding.threads, 4);
  EXPECT_EQ(order.encoding.size_px, host.opened[0].encoding.size_px);
  EXPECT_TRUE(order.force_idr);
  EXPECT_EQ(host.count<StreamConfig>(), 0) << "nothing that the client was told has changed";
}

TEST_F(SessionTest, AFewFailedFramesEndItWithTheirCause) {
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
