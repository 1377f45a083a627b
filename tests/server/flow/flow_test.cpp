// Rate control end to end, without a clock: a Visit behind a simulated link and a simulated
// client. Times are simulated, so that they may be asserted.

#include "tests/server/flow/flow_simulation.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

using std::chrono::microseconds;
using test::FlowScenario;
using test::FlowSimulation;
using test::FrameTrace;

int least_bitrate_kbps(const std::vector<FrameTrace>& frames) {
  return std::ranges::min(frames, {}, &FrameTrace::bitrate_kbps).bitrate_kbps;
}

struct Path {
  const char* name;
  microseconds delay;
  microseconds jitter;
};
void PrintTo(const Path& path, std::ostream* out) { *out << path.name; }

class OnEveryPath : public testing::TestWithParam<Path> {
 protected:
  static FlowScenario scenario(std::vector<test::LinkRate> rates) {
    FlowScenario scenario;
    scenario.link.delay = GetParam().delay;
    scenario.link.jitter = GetParam().jitter;
    scenario.link.rates = std::move(rates);
    return scenario;
  }
};

TEST_P(OnEveryPath, FollowsALinkThatSlowsDownAndRecovers) {
  FlowSimulation simulation(scenario({{0us, 50e6}, {10s, 5e6}, {20s, 50e6}}));
  simulation.run(30s);
  const double before = simulation.sent_kbps(5s, 9s);
  EXPECT_GE(before, 30'000.0);
  EXPECT_LT(simulation.longest_queueing(12s, 20s), 100ms) << "within two seconds, and stays";
  EXPECT_GE(simulation.share_queueing_at_most(50ms, 12s, 20s), 0.8);
  EXPECT_GE(simulation.sent_kbps(12s, 20s), 0.8 * 5000.0) << "the link is made use of";
  EXPECT_GE(simulation.sent_kbps(25s, 30s), 0.9 * before) << "quality is back within five seconds";
  EXPECT_LT(simulation.longest_queueing(21s, 30s), 50ms);
  EXPECT_EQ(simulation.sizes(), 1) << "a want of quality that the bitrate alone can meet";
}

TEST_P(OnEveryPath, ALinkThatRecoversDuringARestIsUsedWithinTwoSecondsOfTheNextMotion) {
  for (const double slow : {4e6, 1e6, 0.5e6}) {
    FlowScenario rests = scenario({{0us, 50e6}, {5s, slow}, {20s, 50e6}});
    rests.rests = {{15s, 30s}};
    FlowSimulation simulation(rests);
    simulation.run(36s);
    const double before = simulation.sent_kbps(3s, 5s);
    EXPECT_LT(simulation.sent_kbps(10s, 15s), 1e-3 * slow) << "the link was slow meanwhile";
    EXPECT_GE(simulation.sent_kbps(32s, 33s), 0.9 * before) << slow;
    for (const FrameTrace& frame : simulation.sent(32s, 36s))
      ASSERT_EQ(frame.ticket.size_px, glm::ivec2(1280, 720)) << slow;
    EXPECT_LT(simulation.longest_queueing(30s, 36s), 50ms) << slow;
  }
}

TEST_P(OnEveryPath, ALinkThatStaysSlowDuringRestsIsNotFilledByTrying) {
  FlowScenario rests = scenario({{0us, 50e6}, {5s, 4e6}});
  for (microseconds at = 15s; at < 60s; at += 8s) rests.rests.push_back({at, at + 4s});
  FlowSimulation simulation(rests);
  simulation.run(60s);
  EXPECT_LT(simulation.longest_queueing(10s, 60s), 150ms);
  EXPECT_GE(simulation.share_queueing_at_most(50ms, 10s, 60s), 0.8);
  EXPECT_EQ(simulation.sizes(), 1);
}

TEST_P(OnEveryPath, ALinkThatFallsToATenthFreezesNothingAndIsUsedSoonAfterItIsBack) {
  for (const std::size_t queue_bytes : {31'250u, 1u << 20}) {
    FlowScenario falls = scenario({{0us, 5e6}, {5s, 0.5e6}, {10s, 5e6}});
    falls.link.queue_bytes = queue_bytes;
    falls.max_bitrate_kbps = 8'000;
    FlowSimulation simulation(falls);
    simulation.run(20s);
    EXPECT_LT(simulation.longest_freeze(4s, 20s), 300ms) << queue_bytes;
    const bool jitters = GetParam().jitter > 0us;  // that hides what the link carries
    const microseconds back = jitters ? 14s : 12s;
    EXPECT_GE(simulation.sent_kbps(back, back + 500ms),
              (jitters ? 0.75 : 0.9) * simulation.sent_kbps(3s, 5s))
        << queue_bytes;
  }
}

TEST_P(OnEveryPath, KeepsItsNominalRateWhereTheLinkIsEnough) {
  FlowSimulation simulation(scenario({{0us, 50e6}}));
  simulation.run(10s);
  EXPECT_GE(simulation.sent(2s, 10s).size(), static_cast<std::size_t>(0.95 * 60 * 8));
}

INSTANTIATE_TEST_SUITE_P(Paths, OnEveryPath,
                         testing::Values(Path{"Near", 2ms, 0ms}, Path{"Usual", 10ms, 0ms},
                                         Path{"Wireless", 10ms, 15ms}, Path{"Far", 50ms, 10ms}),
                         [](const auto& instance) { return std::string(instance.param.name); });

// Room for 200 ms of the link in its queue, which any sender that only minds losses would fill.
TEST(Flow, LeavesADeepQueueEmpty) {
  FlowScenario scenario;
  scenario.link.rates = {{0us, 3e6}};
  scenario.link.queue_bytes = 75'000;
  FlowSimulation simulation(scenario);
  simulation.run(20s);
  EXPECT_LT(simulation.longest_queueing(2s, 20s), 100ms);
  EXPECT_GE(simulation.share_queueing_at_most(50ms, 2s, 20s), 0.8);
  EXPECT_GE(simulation.sent_kbps(2s, 20s), 0.8 * 3000.0);
}

// TCP delivers nothing for 300 ms every two seconds. That makes nothing of the bitrate.
TEST(Flow, TakesBurstsOfLossesForWhatTheyAre) {
  FlowScenario scenario;
  scenario.link.rates = {{0us, 20e6}};
  for (microseconds at = 3s; at < 20s; at += 2s) scenario.link.stalls.push_back({at, at + 300ms});
  FlowSimulation simulation(scenario);
  simulation.run(20s);
  EXPECT_GE(least_bitrate_kbps(simulation.sent(3s, 20s)), 14'000);
  for (const auto& stall : scenario.link.stalls) {
    const auto during = simulation.sent(stall.from + 100ms, stall.to);
    EXPECT_LE(during.size(), 2u) << "what would only queue is not rendered";
    EXPECT_LT(simulation.longest_queueing(stall.to + 100ms, stall.to + 1s), 100ms);
  }
}

TEST(Flow, PacesAndShrinksForASlowDecoder) {
  FlowScenario scenario;
  scenario.client.decode_s_per_megapixel = 0.040;  // 27 frames of 1280x720 a second
  FlowSimulation simulation(scenario);
  simulation.run(60s);
  EXPECT_EQ(simulation.frames().back().ticket.size_px, glm::ivec2(960, 540));
  EXPECT_GE(simulation.presented(5s, 60s), 40 * 55);
  EXPECT_LT(simulation.oldest_shown(5s, 60s), 150ms)
      << "frames do not wait in front of the decoder";
  EXPECT_LE(simulation.sizes(), 6) << "no flapping";
}

TEST(Flow, ADecoderThatHardlyWorksStillShowsSomething) {
  FlowScenario scenario;
  scenario.client.decode_s_per_megapixel = 0.4;  // 2.7 frames of 1280x720 a second
  FlowSimulation simulation(scenario);
  simulation.run(60s);
  EXPECT_EQ(simulation.frames().back().ticket.size_px, glm::ivec2(640, 360));
  EXPECT_GE(simulation.presented(30s, 60s), 8 * 30);
  EXPECT_LT(simulation.oldest_shown(30s, 60s), 500ms);
}

TEST(Flow, WaitsForAPhoneThatSleeps) {
  FlowScenario scenario;
  scenario.client.sleeps = {{5s, 15s}};
  FlowSimulation simulation(scenario);
  simulation.run(25s);
  EXPECT_LE(simulation.sent(5s, 15s).size(), 8u);
  EXPECT_GE(simulation.presented(15s, 16s), 50);
  EXPECT_LT(simulation.oldest_shown(15s + 200ms, 25s), 100ms);
  EXPECT_LT(simulation.longest_queueing(15s, 25s), 50ms);
  EXPECT_GE(least_bitrate_kbps(simulation.sent(20s, 25s)), 30'000);
}

TEST(Flow, StepsDownTheLadderAndUpAgain) {
  FlowScenario scenario;
  scenario.link.rates = {{0us, 50e6}, {5s, 0.5e6}, {20s, 50e6}};
  FlowSimulation simulation(scenario);
  simulation.run(35s);
  EXPECT_EQ(simulation.sent(15s, 20s).back().ticket.size_px, glm::ivec2(640, 360));
  EXPECT_LT(simulation.longest_queueing(12s, 20s), 150ms);
  EXPECT_EQ(simulation.frames().back().ticket.size_px, glm::ivec2(1280, 720));
  EXPECT_EQ(simulation.sizes(), 5) << "the first, two steps down, two up";
}

// A link that is hardly enough for a rung, and content that asks for all of it.
TEST(Flow, DoesNotFlap) {
  for (const double bits_per_s : {1.2e6, 1.4e6, 1.6e6, 1.8e6, 2.2e6, 2.6e6}) {
    FlowScenario scenario;
    scenario.link.rates = {{0us, bits_per_s}};
    FlowSimulation simulation(scenario);
    simulation.run(120s);
    EXPECT_LE(simulation.sizes(), 6) << bits_per_s;
  }
}

TEST(Flow, SimpleContentKeepsItsSize) {
  FlowScenario scenario;
  scenario.link.rates = {{0us, 3e6}};
  scenario.demand_bits_per_pixel = 0.01;
  FlowSimulation simulation(scenario);
  simulation.run(10s);
  EXPECT_EQ(simulation.sizes(), 1);
}

TEST(Flow, LeavesAFixedQualityAlone) {
  FlowScenario scenario;
  scenario.link.rates = {{0us, 5e6}};
  scenario.fixed_quality = true;
  FlowSimulation simulation(scenario);
  simulation.run(10s);
  EXPECT_EQ(least_bitrate_kbps(simulation.frames()), scenario.max_bitrate_kbps);
  EXPECT_EQ(simulation.sizes(), 1);
}

// Whatever the ladder makes of moving pictures: one that stays is full size and sharp.
struct StillCase {
  const char* name;
  double bits_per_s;
  microseconds sharp_within;
};
void PrintTo(const StillCase& still, std::ostream* out) { *out << still.name; }

class Stills : public testing::TestWithParam<StillCase> {};

TEST_P(Stills, AreSharpSoonAfterMotionStops) {
  FlowScenario scenario;
  scenario.link.rates = {{0us, GetParam().bits_per_s}};
  scenario.rests = {{20s, 25s}};
  scenario.size_px = {426, 240};  // for a processor that keeps up with no more, say
  scenario.still_size_px = {1280, 720};
  FlowSimulation simulation(scenario);
  simulation.run(30s);
  const auto sharp = simulation.sharp_after(20s, {1280, 720});
  ASSERT_TRUE(sharp);
  EXPECT_LE(*sharp, GetParam().sharp_within);
  RecordProperty("sharp_after_ms", static_cast<int>(sharp->count() / 1000));
  EXPECT_LT(simulation.longest_queueing(18s, 26s), 100ms) << "nor does the next motion wait for it";
  EXPECT_TRUE(simulation.sent(23s, 25s).empty()) << "then there is nothing to send";
  const double before = simulation.sent_kbps(15s, 20s);
  EXPECT_GE(simulation.sent_kbps(26s, 30s), 0.85 * before) << "what was learnt of the link is kept";
  EXPECT_LE(simulation.presented(25s, 30s), 5 * 60 + 2);
  EXPECT_GE(simulation.presented(25s, 30s), 0.9 * simulation.presented(15s, 20s));
}

INSTANTIATE_TEST_SUITE_P(Links, Stills,
                         testing::Values(StillCase{"At50Mbit", 50e6, 200ms},
                                         StillCase{"At5Mbit", 5e6, 400ms},
                                         StillCase{"At1Mbit", 1e6, 1200ms}),
                         [](const auto& instance) { return std::string(instance.param.name); });

TEST(Flow, AStillForASlowDecoderIsFullSizeToo) {
  FlowScenario scenario;
  scenario.client.decode_s_per_megapixel = 0.1;
  scenario.rests = {{30s, 35s}};
  FlowSimulation simulation(scenario);
  simulation.run(40s);
  ASSERT_LT(simulation.sent(25s, 30s).back().ticket.size_px.x, 1280);
  EXPECT_TRUE(simulation.sharp_after(30s, {1280, 720}));
  EXPECT_EQ(simulation.frames().back().ticket.size_px,
            simulation.sent(25s, 30s).back().ticket.size_px)
      << "its decoding time is not taken for that of moving pictures";
  EXPECT_GE(simulation.presented(39s, 40s), 0.9 * simulation.presented(29s, 30s));
}

TEST(FlowControl, AcknowledgedFramesStandInNoQueue) {
  FlowControl flow;
  flow.set_request({{1280, 720}, 60, 8'000, false});
  TimePoint now = TimePoint{} + 1h;
  constexpr std::size_t bytes = 40'000;  // 40 ms at 8 Mbit/s
  for (std::uint64_t id = 1; id <= 60; ++id) {
    flow.sent({id, bytes, {1280, 720}}, now);
    now += 20ms;
    Ack ack;
    ack.frame_id = id;
    ack.received_us = ack.decoded_us = ack.presented_us =
        std::chrono::duration_cast<microseconds>(now.time_since_epoch()).count();
    ASSERT_TRUE(flow.acknowledged(ack, now));
  }
  EXPECT_EQ(flow.standing(now), 0us) << "the link carries more than it was asked to";
  flow.sent({61, bytes, {1280, 720}}, now);
  EXPECT_EQ(flow.standing(now), flow.time_on_link(bytes, now));
  EXPECT_EQ(flow.standing(now + 1s), 0us);
}

TEST(FlowControl, AFrameThatWasGivenUpUnseenTellsNothingOfTheLink) {
  FlowControl flow;
  flow.set_request({{1280, 720}, 60, 20'000, false});
  TimePoint now = TimePoint{} + 1h;
  std::uint64_t id = 0;
  const auto pass = [&](std::chrono::milliseconds delay, bool given_up) {
    now += 20ms;
    flow.sent({++id, 20'000, {1280, 720}}, now);
    const TimePoint there = now + delay;
    Ack ack;
    ack.frame_id = id;
    ack.dropped = given_up;
    if (!given_up)
      ack.received_us = ack.decoded_us = ack.presented_us =
          std::chrono::duration_cast<std::chrono::microseconds>(there.time_since_epoch()).count();
    EXPECT_TRUE(flow.acknowledged(ack, there));
  };
  for (int i = 0; i < 20; ++i) pass(10ms, false);
  for (int i = 0; i < 20; ++i) pass(90ms, false);
  ASSERT_GT(flow.queue_delay(), 60ms);
  for (int i = 0; i < 5; ++i) pass(90ms, true);
  EXPECT_GT(flow.queue_delay(), 60ms) << "the queue is still there";
}

}  // namespace
}  // namespace catgs
