// What a client is told of the frames that it was sent.

#include "server/visit/visit_statistics.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

TEST(VisitStatisticsTest, AreToldOnceASecondWhileFramesFlow) {
  TimePoint now = TimePoint{} + 1h;
  const FlowControl flow;
  VisitStatistics statistics(now);
  for (const std::size_t bytes : {100, 50, 50}) statistics.frame_sent(bytes);
  statistics.frames_lost(2);
  EXPECT_FALSE(statistics.take(flow, 3, now += 999ms));
  const auto stats = statistics.take(flow, 3, now += 1ms);
  ASSERT_TRUE(stats);
  EXPECT_FLOAT_EQ(stats->fps, 3.0f);
  EXPECT_FLOAT_EQ(stats->bitrate_kbps, 1.6f);
  EXPECT_EQ(stats->dropped_packets, 2u);
  EXPECT_EQ(stats->sessions, 3u);
  EXPECT_EQ(stats->target_bitrate_kbps, flow.bitrate_kbps());

  EXPECT_FALSE(statistics.take(flow, 3, now += 1s)) << "the heartbeat speaks for a still picture";
  statistics.frame_sent(100);
  const auto next = statistics.take(flow, 3, now += 1s);
  ASSERT_TRUE(next);
  EXPECT_FLOAT_EQ(next->fps, 1.0f);
  EXPECT_EQ(next->dropped_packets, 0u) << "told already";
  statistics.frame_dropped_by_client();
  EXPECT_EQ(statistics.frames_sent(), 4u);
  EXPECT_EQ(statistics.frames_dropped(), 3u);
  EXPECT_EQ(statistics.bytes_sent(), 300u);
}

TEST(VisitStatisticsTest, TellWhatTheGpuDrewAndFromWhichLists) {
  TimePoint now = TimePoint{} + 1h;
  const FlowControl flow;
  VisitStatistics statistics(now);
  FrameStats key, sub, cut;
  sub.kind = FrameKind::sub;
  cut.cut_window = true;
  for (const FrameStats& frame : {key, sub, sub, sub, cut, sub}) {
    statistics.frame_drawn(frame, 0.5e-3);
    statistics.frame_sent(100);
  }
  const auto stats = statistics.take(flow, 1, now += 1s);
  ASSERT_TRUE(stats);
  EXPECT_FLOAT_EQ(stats->device_ms, 0.5f);
  EXPECT_FLOAT_EQ(stats->frames_per_key, 3.0f);
  EXPECT_EQ(stats->windows_cut, 1u);
}

}  // namespace
}  // namespace catgs
