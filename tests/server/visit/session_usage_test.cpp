#include "server/visit/session_usage.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

TEST(RecentTimes, GivePercentilesOfTheLastOnes) {
  RecentTimes times;
  EXPECT_FALSE(times.percentiles());
  times.add(3.0);
  EXPECT_EQ(times.percentiles()->p50, 3.0);
  EXPECT_EQ(times.percentiles()->p99, 3.0);
  for (int i = 0; i < 1000; ++i) times.add(100.0);
  for (int i = 1; i <= 128; ++i) times.add(i);
  const auto recent = times.percentiles();
  EXPECT_EQ(recent->p50, 64.0);
  EXPECT_EQ(recent->p95, 122.0);
  EXPECT_EQ(recent->p99, 127.0);
}

class SessionUsageTest : public testing::Test {
 protected:
  void frame(std::chrono::milliseconds duration, double device_s = 0.0, bool refined = false) {
    FrameTicket ticket;
    ticket.still = refined;
    ticket.refined = refined;
    usage.frame_started(now);
    now += duration;
    usage.frame_ended(ticket, device_s, now);
  }
  TimePoint now = TimePoint{} + 1h;
  SessionUsage usage;
};

TEST_F(SessionUsageTest, IsBusyWhileAFrameIsUnderWay) {
  frame(30ms);
  now += 100ms;
  frame(20ms);
  EXPECT_DOUBLE_EQ(usage.take_busy_seconds(now), 0.05);
  EXPECT_DOUBLE_EQ(usage.take_busy_seconds(now), 0.0);
  usage.frame_started(now);
  EXPECT_DOUBLE_EQ(usage.take_busy_seconds(now + 1s), 1.0) << "a long frame counts as it goes";
  usage.frame_ended({}, 0.0, now + 1500ms);
  EXPECT_DOUBLE_EQ(usage.take_busy_seconds(now + 2s), 0.5);
}

TEST_F(SessionUsageTest, KnowsWhatAFrameCosts) {
  EXPECT_FALSE(usage.frame_cost());
  for (int i = 0; i < 20; ++i) {
    frame(10ms, 0.004);
    frame(1ms, 0.0,
          true);  // encoded once more, not rendered: no frame of the motion costs so little
    usage.charge_cpu(0.015, 0.25);
  }
  ASSERT_TRUE(usage.frame_cost());
  EXPECT_NEAR(usage.frame_cost()->cpu_seconds, 0.015, 1e-9);
  EXPECT_NEAR(usage.frame_cost()->gpu_seconds, 0.004, 1e-9);
  EXPECT_NEAR(usage.cpu_seconds(), 0.3, 1e-9);
  EXPECT_NEAR(usage.gpu_seconds(), 0.08, 1e-9);
  for (int i = 0; i < 500; ++i) {
    frame(10ms);
    usage.charge_cpu(0.045, 0.25);
  }
  EXPECT_NEAR(usage.frame_cost()->cpu_seconds, 0.045, 1e-4) << "it follows";
}

TEST_F(SessionUsageTest, KnowsWhatKeepsAGpuAndAnEncoderBusy) {
  const auto run = [&](double device_s, std::chrono::milliseconds encoding) {
    for (int i = 0; i < 80; ++i) {  // 20 s
      FrameTicket ticket;
      ticket.encode = {now, now + encoding};
      usage.frame_ended(ticket, device_s, now);
      usage.charge_cpu(0.0, 0.25);
    }
  };
  EXPECT_FALSE(usage.gpu_load()) << "nothing was measured";
  run(0.05, 10ms);
  ASSERT_TRUE(usage.gpu_load());
  EXPECT_NEAR(*usage.gpu_load(), 0.2, 1e-3);
  EXPECT_NEAR(usage.encoder_load(), 0.04, 1e-3);
  EXPECT_NEAR(usage.encode_seconds(), 0.01, 1e-4);
  for (int i = 0; i < 80; ++i) usage.charge_cpu(0.0, 0.25);
  EXPECT_NEAR(*usage.gpu_load(), 0.0, 1e-3) << "it stands still";
  EXPECT_NEAR(usage.encode_seconds(), 0.01, 1e-4) << "what the next one will take";
}

TEST_F(SessionUsageTest, AFrameWhoseEncoderCannotBeOpenedTookNoEncodingTime) {
  FrameTicket ticket;
  ticket.render = {now - 5ms, now};
  usage.frame_ended(ticket, 0.0, now);
  usage.charge_cpu(0.01, 0.25);
  EXPECT_EQ(usage.encoder_load(), 0.0);
  EXPECT_EQ(usage.encode_seconds(), 0.0);
}

TEST_F(SessionUsageTest, AStillCountsAsSoManyFramesAsItHasPixels) {
  for (int i = 0; i < 16; ++i) frame(5ms);
  usage.charge_cpu(16 * 0.005, 0.25);
  FrameTicket still;
  still.still = true;
  for (int i = 0; i < 16; ++i) {
    usage.frame_started(now);
    usage.frame_ended(still, 0.0, now += 20ms, 4.0);
    usage.charge_cpu(0.020, 0.25);
  }
  EXPECT_NEAR(usage.frame_cost()->cpu_seconds, 0.005, 1e-9);
}

TEST_F(SessionUsageTest, TimesOfStillsAreNoLatency) {
  FrameTicket ticket;
  ticket.pose_received = now;
  ticket.ready = now + 1ms;
  ticket.started = now + 3ms;
  ticket.render = {now + 4ms, now + 9ms};
  ticket.encode = {now + 9ms, now + 11ms};
  usage.frame_sent(ticket, now + 12ms);
  ticket.still = true;
  usage.frame_sent(ticket, now + 10s);
  EXPECT_DOUBLE_EQ(usage.times(SessionTime::queue_wait).percentiles()->p99, 0.002);
  EXPECT_DOUBLE_EQ(usage.times(SessionTime::render).percentiles()->p99, 0.005);
  EXPECT_DOUBLE_EQ(usage.times(SessionTime::encode).percentiles()->p99, 0.002);
  EXPECT_DOUBLE_EQ(usage.times(SessionTime::pose_to_frame).percentiles()->p99, 0.012);
  EXPECT_FALSE(usage.times(SessionTime::motion_to_photon).percentiles());
}

TEST(ShareOut, FollowsBusyTimeAndLosesNothing) {
  EXPECT_EQ(share_out(6.0, {1.0, 0.0, 2.0}), (std::vector{2.0, 0.0, 4.0}));
  EXPECT_EQ(share_out(6.0, {0.0, 0.0}), (std::vector{0.0, 0.0})) << "nobody was at work";
  EXPECT_TRUE(share_out(6.0, {}).empty());
}

}  // namespace
}  // namespace catgs
