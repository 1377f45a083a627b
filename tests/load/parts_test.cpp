#include "render_core/base/error.h"
#include "tests/load/histogram.h"
#include "tests/load/pose_replay.h"
#include "tests/load/requirement.h"
#include "tests/load/session_stats.h"
#include "tests/load/url.h"
#include "tests/load/wire_client.h"
#include "tests/support/test.h"

namespace catgs::load {
namespace {

TEST(Url, TakesEveryForm) {
  const Url plain = parse_url("ws://127.0.0.1:8080");
  EXPECT_FALSE(plain.tls);
  EXPECT_EQ(plain.host, "127.0.0.1");
  EXPECT_EQ(plain.port, "8080");
  EXPECT_EQ(plain.path, "/");
  EXPECT_EQ(parse_url("ws://host").port, "80");
  EXPECT_EQ(parse_url("wss://host/a/b").port, "443");
  EXPECT_EQ(parse_url("wss://host/a/b").path, "/a/b");
  const Url ipv6 = parse_url("wss://[::1]:9000/x");
  EXPECT_TRUE(ipv6.tls);
  EXPECT_EQ(ipv6.host, "::1");
  EXPECT_EQ(ipv6.port, "9000");
  EXPECT_EQ(ipv6.authority(), "[::1]:9000");
  EXPECT_EQ(parse_url("ws://[::1]").port, "80");
}

TEST(Url, RefusesWhatIsNone) {
  for (const char* bad :
       {"", "http://host", "host:80", "ws://", "ws://:80", "ws://host:", "ws://host:0",
        "ws://host:65536", "ws://host:8a", "ws://[::1", "ws://[]", "ws://[::1]x:5",
        "ws://host/?token=secret", "ws://host/#secret", "ws://user@host"}) {
    EXPECT_THROW(parse_url(bad), InputError) << bad;
  }
}

TEST(DurationHistogram, PercentilesAreCloseAndTheRestIsExact) {
  DurationHistogram histogram;
  for (int i = 1; i <= 100'000; ++i) histogram.add(i);  // 1 us … 100 ms
  EXPECT_EQ(histogram.count(), 100'000u);
  EXPECT_NEAR(histogram.percentile_ms(0.50), 50.0, 50.0 * 0.008);
  EXPECT_NEAR(histogram.percentile_ms(0.99), 99.0, 99.0 * 0.008);
  EXPECT_NEAR(histogram.percentile_ms(0.0001), 0.010, 1e-9);
  EXPECT_DOUBLE_EQ(histogram.max_ms(), 100.0);
  EXPECT_NEAR(histogram.mean_ms(), 50.0005, 1e-9);
}

TEST(DurationHistogram, TakesEveryMagnitude) {
  for (double value = 1.0; value < 1e11; value *= 1.7) {
    DurationHistogram histogram;
    histogram.add(static_cast<std::int64_t>(value));
    histogram.add(std::int64_t{1} << 39);
    EXPECT_NEAR(histogram.percentile_ms(0.5), 1e-3 * std::floor(value), 1e-3 * value * 0.008);
  }
  DurationHistogram histogram;
  histogram.add(-5);
  EXPECT_EQ(histogram.percentile_ms(1.0), 0.0);
  histogram.add(INT64_MAX);
  EXPECT_GT(histogram.percentile_ms(1.0), 1e8);
  EXPECT_TRUE(std::isnan(DurationHistogram().percentile_ms(0.5)));
}

TEST(DurationHistogram, Adds) {
  DurationHistogram a, b;
  a.add(1000);
  b.add(3000);
  b.add(5000);
  a.add(b);
  EXPECT_EQ(a.count(), 3u);
  EXPECT_DOUBLE_EQ(a.mean_ms(), 3.0);
  EXPECT_DOUBLE_EQ(a.max_ms(), 5.0);
}

std::shared_ptr<const Trajectory> three_poses() {
  return std::make_shared<const Trajectory>(Trajectory{{5'000, {glm::vec3(0), {1, 0, 0, 0}}},
                                                       {15'000, {glm::vec3(1), {1, 0, 0, 0}}},
                                                       {45'000, {glm::vec3(2), {1, 0, 0, 0}}}});
}

TEST(PoseReplay, GoesForthAndBackAtNativeTimes) {
  PoseReplay replay(three_poses(), 0);
  EXPECT_EQ(replay.span_us(), 40'000);
  const std::vector<std::pair<std::int64_t, float>> expected = {
      {0, 0}, {10'000, 1}, {40'000, 2}, {70'000, 1}, {80'000, 0}, {90'000, 1}, {120'000, 2}};
  for (const auto& [time_us, x] : expected) {
    EXPECT_EQ(replay.next_time_us(), time_us);
    EXPECT_EQ(replay.take().position.x, x) << time_us;
  }
}

TEST(PoseReplay, BeginsAtItsOffset) {
  PoseReplay replay(three_poses(), 12'000);
  EXPECT_EQ(replay.next_time_us(), 28'000);
  EXPECT_EQ(replay.take().position.x, 2.0f);
  PoseReplay wrapped(three_poses(), 80'000 + 12'000);
  EXPECT_EQ(wrapped.next_time_us(), 28'000);
}

TEST(PoseReplay, RepeatsASinglePose) {
  PoseReplay replay(
      std::make_shared<const Trajectory>(Trajectory{{7, {glm::vec3(3), {1, 0, 0, 0}}}}), 1'000);
  std::int64_t last = -1;
  for (int i = 0; i < 5; ++i) {
    EXPECT_GT(replay.next_time_us(), last);
    last = replay.next_time_us();
    EXPECT_EQ(replay.take().position.x, 3.0f);
  }
}

TEST(Requirement, ComparesByItsOperator) {
  const Metrics metrics = {{"errors", 0.0}, {"fps_min", 59.5}};
  const auto holds = [&](std::string_view text) { return Requirement(text).holds(metrics); };
  EXPECT_TRUE(holds("errors==0"));
  EXPECT_FALSE(holds("errors != 0"));
  EXPECT_TRUE(holds(" fps_min >= 59.5 "));
  EXPECT_FALSE(holds("fps_min>59.5"));
  EXPECT_TRUE(holds("fps_min<6e1"));
  EXPECT_FALSE(holds("fps_min<=-1"));
  EXPECT_THAT(Requirement("fps_min>60").explain(metrics), HasSubstr("fps_min>60: is 59.5"));
}

TEST(Requirement, RefusesBadGrammarAndUnknownMetrics) {
  for (const char* bad : {"", "errors", "errors=0", "errors<", "<5", "errors<x", "errors<1 2",
                          "errors<nan", "errors=<1", "errors<<1"}) {
    EXPECT_THROW(Requirement{bad}, InputError) << bad;
  }
  EXPECT_THAT(
      [] {
        Requirement("fsp_min>1").check_name({{"errors", 0.0}, {"fps_min", 0.0}});
      },
      ThrowsMessage<InputError>(HasSubstr("fsp_min")));
}

ReceivedFrame frame(std::uint64_t frame_id, std::uint64_t pose_id) {
  return {.frame_id = frame_id, .pose_id = pose_id, .idr = frame_id == 1, .bytes = 1000};
}

TEST(SessionStats, MeasuresOnTheClientsClock) {
  SessionStats stats(100.0);  // a tick every 10 ms
  stats.started(1'000'000);
  stats.pose_sent(1, 1'000'000);
  stats.pose_sent(2, 1'010'000);
  stats.frame_received(frame(1, 1), 1'030'000);
  stats.frame_received(frame(2, 2), 1'050'000);
  stats.finished(1'080'000);
  EXPECT_EQ(stats.counts.errors, 0u);
  EXPECT_EQ(stats.durations.pose_to_frame.count(), 2u);
  EXPECT_DOUBLE_EQ(stats.durations.pose_to_frame.mean_ms(), 35.0);
  EXPECT_EQ(stats.durations.frame_interval.count(), 1u);
  EXPECT_DOUBLE_EQ(stats.durations.frame_interval.mean_ms(), 20.0);
  // Ticks at 1000, 1010, 1020 have no picture yet: 0, 10, 20 ms since the start; at 1030, 1040 see
  // pose 1 (30, 40 ms old); at 1050, 1060, 1070 pose 2 (40, 50, 60).
  EXPECT_EQ(stats.durations.pose_age.count(), 8u);
  EXPECT_DOUBLE_EQ(stats.durations.pose_age.mean_ms(), 31.25);
  EXPECT_DOUBLE_EQ(stats.durations.pose_age.max_ms(), 60.0);
  EXPECT_DOUBLE_EQ(stats.fps(), 25.0);
  EXPECT_DOUBLE_EQ(stats.bitrate_kbps(), 200.0);
  EXPECT_EQ(stats.counts.idrs, 1u);
}

TEST(SessionStats, AFreezeAgesThePicture) {
  SessionStats stats(60.0);
  stats.started(0);
  stats.pose_sent(1, 0);
  stats.frame_received(frame(1, 1), 20'000);
  stats.finished(2'000'000);
  EXPECT_NEAR(stats.durations.pose_age.percentile_ms(1.0), 1983.0, 16.0);
}

TEST(SessionStats, RefinementsAreNoNewPoses) {
  SessionStats stats(60.0);
  stats.started(0);
  stats.pose_sent(1, 1'000);
  stats.frame_received(frame(1, 1), 20'000);
  stats.frame_received(frame(2, 1), 90'000);
  EXPECT_EQ(stats.durations.pose_to_frame.count(), 1u);
  EXPECT_EQ(stats.counts.repeated_poses, 1u);
  EXPECT_EQ(stats.counts.errors, 0u);
}

TEST(SessionStats, CountsWhatCannotBe) {
  SessionStats stats(60.0);
  stats.started(0);
  stats.pose_sent(1, 0);
  stats.pose_sent(2, 0);
  stats.frame_received(frame(1, 7), 1);  // never sent
  stats.frame_received(frame(2, 0), 2);  // no pose at all
  stats.frame_received(frame(3, 2), 3);
  stats.frame_received(frame(4, 1), 4);  // back in time
  stats.frame_received(frame(4, 2), 5);  // same frame again
  EXPECT_EQ(stats.counts.errors, 4u);
  EXPECT_EQ(stats.error_counts.size(), 3u);
  for (int i = 0; i < 1000; ++i) stats.error("error " + std::to_string(i));
  EXPECT_EQ(stats.counts.errors, 1004u);
  EXPECT_LE(stats.error_counts.size(), 33u);
}

TEST(SessionStats, AReconnectionIsNoFrameInterval) {
  SessionStats stats(60.0);
  stats.started(0);
  stats.pose_sent(1, 0);
  stats.frame_received(frame(9, 1), 20'000);
  stats.started(5'000'000);
  stats.pose_sent(2, 5'000'000);
  stats.frame_received(frame(1, 2), 5'020'000);
  EXPECT_EQ(stats.durations.frame_interval.count(), 0u);
  EXPECT_EQ(stats.counts.errors, 0u);
  EXPECT_DOUBLE_EQ(stats.durations.pose_to_frame.max_ms(), 20.0);
  EXPECT_GT(stats.durations.pose_age.max_ms(), 4900.0);  // the picture stood still meanwhile
}

std::vector<std::byte> bytes_of(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

TEST(WireClient, ReadsMessagesAndFrames) {
  v1::ServerMessage message;
  message.mutable_heartbeat()->set_server_time_us(5);
  const std::string packed = '\x01' + message.SerializeAsString();
  const auto parsed = parse_server_message(std::as_bytes(std::span(packed)));
  EXPECT_EQ(std::get<v1::ServerMessage>(parsed).heartbeat().server_time_us(), 5);

  // Kind 2, header of 4 bytes (frame_id 3, pose_id 4), bitstream of 2.
  const auto frame_bytes = bytes_of({2, 4, 0x08, 3, 0x10, 4, 0xaa, 0xbb});
  const auto frame_message = std::get<FrameMessage>(parse_server_message(frame_bytes));
  EXPECT_EQ(frame_message.header.frame_id(), 3u);
  EXPECT_EQ(frame_message.header.pose_id(), 4u);
  ASSERT_EQ(frame_message.bitstream.size(), 2u);
  EXPECT_EQ(frame_message.bitstream[0], std::byte{0xaa});
}

TEST(WireClient, RefusesDamage) {
  for (const auto& bad :
       {bytes_of({}), bytes_of({0}), bytes_of({3, 1}), bytes_of({1, 0xff}), bytes_of({2}),
        bytes_of({2, 0x80}), bytes_of({2, 0xff, 0xff, 0xff, 0xff, 0xff, 1}), bytes_of({2, 9, 1}),
        bytes_of({2, 2, 0x08, 3}), bytes_of({2, 1, 0xff, 5}),
        bytes_of({2, 0xff, 0xff, 0xff, 0xff, 0x0f, 1})}) {
    EXPECT_TRUE(std::holds_alternative<WireError>(parse_server_message(bad)));
  }
}

TEST(WireClient, PosesSurviveTheRoundTrip) {
  const Pose pose{glm::vec3(1, -2, 3), glm::quat(0.5f, -0.5f, 0.5f, 0.5f)};
  EXPECT_EQ(from_wire(to_wire(pose)).position, pose.position);
  EXPECT_EQ(from_wire(to_wire(pose)).orientation, pose.orientation);
}

}  // namespace
}  // namespace catgs::load
