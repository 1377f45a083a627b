#include "server/flow/rate_controller.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

using std::chrono::microseconds;

constexpr RateController::Limits limits{1e5, 40e6, 10e6};

/// Frames of a nominal 60 Hz that arrive as they are told to.
struct Feed {
  RateController controller{limits};
  TimePoint now = TimePoint{} + 1h;
  std::int64_t client_us = -5'000'000;

  /// `queue` on top of a path of 20 ms; the frame used `share` of the rate.
  void frame(microseconds queue, double share = 1.0, microseconds clock_jump = 0us,
             microseconds own = 0us) {
    now += 16'667us;
    client_us += 16'667;
    RateController::Sample sample;
    sample.delays_us = {(20ms + queue + clock_jump).count() - 7'000'000, (45ms + queue).count()};
    sample.finished_us = client_us + queue.count() + clock_jump.count();
    sample.units = share * controller.rate() / 60.0;
    sample.round_trip = 45ms + queue;
    sample.own = own;
    controller.add(sample, now);
  }
  void frames(int count, microseconds queue, double share = 1.0, microseconds clock_jump = 0us) {
    for (int i = 0; i < count; ++i) frame(queue, share, clock_jump);
  }
};

TEST(RateController, GrowsWhereNothingQueues) {
  Feed feed;
  feed.frames(120, 0us);
  EXPECT_EQ(feed.controller.rate(), limits.most);
  EXPECT_EQ(feed.controller.queue_delay(), 0us);
}

TEST(RateController, DoesNotGuessWhatWasNotTried) {
  Feed feed;
  feed.frames(120, 0us, 0.1);
  EXPECT_EQ(feed.controller.rate(), limits.start);
}

TEST(RateController, BacksOffToWhatPasses) {
  Feed feed;
  feed.frames(20, 0us);
  const double before = feed.controller.rate();
  feed.frames(20, 30ms);
  EXPECT_LT(feed.controller.rate(), 0.95 * before);
  EXPECT_GT(feed.controller.rate(), 0.7 * before);
  EXPECT_EQ(feed.controller.queue_delay(), 30ms);
}

TEST(RateController, JitterIsNoQueue) {
  Feed feed;
  for (int i = 0; i < 300; ++i) feed.frame(microseconds(i * 7919 % 30'000));
  EXPECT_EQ(feed.controller.rate(), limits.most);
}

TEST(RateController, AJumpOfTheClientsClockIsNoQueue) {
  Feed feed;
  feed.frames(60, 0us);
  const double before = feed.controller.rate();
  feed.frames(60, 0us, 1.0, 3s);
  EXPECT_GE(feed.controller.rate(), before);
  feed.frames(60, 0us, 1.0, -3s);
  EXPECT_GE(feed.controller.rate(), before);
}

TEST(RateController, NoClaimOfAClientMakesAQueueOfDays) {
  RateController controller(limits);
  TimePoint now = TimePoint{} + 1h;
  for (const std::int64_t delay_us : {std::int64_t{0}, std::int64_t{1} << 53}) {
    for (int i = 0; i < 16; ++i) {
      RateController::Sample sample;
      sample.delays_us[0] = delay_us;
      sample.finished_us = delay_us + i;
      sample.units = 1000.0;
      sample.round_trip = 45ms;
      controller.add(sample, now += 16ms);
    }
  }
  EXPECT_EQ(controller.queue_delay(), 10s);
}

TEST(RateController, APathThatBecameLongerIsNoQueueForLong) {
  Feed feed;
  feed.frames(120, 0us);
  feed.frames(600, 60ms);
  EXPECT_EQ(feed.controller.queue_delay(), 0us);
  EXPECT_EQ(feed.controller.rate(), limits.most);
}

TEST(RateController, BeginsAnewAfterNothingPassed) {
  Feed feed;
  feed.frames(120, 0us);
  feed.now += 5s;  // still: nothing was on its way
  feed.client_us += 5'000'000;
  feed.frame(0us);
  EXPECT_EQ(feed.controller.rate(), limits.most);
  feed.now += 5s;  // stuck
  feed.frame(5s);
  EXPECT_LE(feed.controller.rate(), limits.start / 4);
}

TEST(RateController, AFrameLargeOnPurposeIsNoQueue) {
  Feed feed;
  feed.frames(60, 0us);
  const double before = feed.controller.rate();
  for (int i = 0; i < 20; ++i) feed.frame(60ms, 1.0, 0us, 60ms);
  EXPECT_EQ(feed.controller.queue_delay(), 0us);
  EXPECT_GE(feed.controller.rate(), before);
  for (int i = 0; i < 20; ++i) feed.frame(90ms, 1.0, 0us, 60ms);
  EXPECT_EQ(feed.controller.queue_delay(), 30ms) << "what stands in front of it is";
  EXPECT_LT(feed.controller.rate(), before);
}

TEST(RateController, OnlyWhatPassedWhenBusySurelyPasses) {
  Feed feed;
  EXPECT_EQ(feed.controller.steady_rate(feed.now), feed.controller.rate()) << "nothing is known";
  feed.frames(3, 0us);
  feed.frames(20, 30ms);
  const double when_busy = feed.controller.steady_rate(feed.now);
  feed.frames(300, 0us);
  EXPECT_GT(feed.controller.rate(), 1.2 * when_busy);
  EXPECT_LT(feed.controller.steady_rate(feed.now), 1.2 * when_busy);
  EXPECT_EQ(feed.controller.steady_rate(feed.now + 10s), feed.controller.rate())
      << "that is too long ago";
}

TEST(RateController, StaysWithinItsLimits) {
  Feed feed;
  feed.frames(60, 0us);
  feed.controller.set_limits({1e5, 2e6, 2e6});
  EXPECT_EQ(feed.controller.rate(), 2e6);
  for (int i = 0; i < 2000; ++i) feed.frame(microseconds(i * 1000));
  EXPECT_GE(feed.controller.rate(), 1e5);
}

}  // namespace
}  // namespace catgs
