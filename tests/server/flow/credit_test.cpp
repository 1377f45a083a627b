#include "server/flow/credit.h"

#include "server/base/rate_limit.h"
#include "server/flow/frame_size.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

TEST(CreditWindow, LimitFollowsTheRoundTrip) {
  struct Case {
    std::chrono::microseconds rtt;
    int limit;
  };
  for (const auto& [rtt, limit] :
       {Case{1us, 2}, Case{10ms, 2}, Case{11ms, 3}, Case{35ms, 5}, Case{1s, 8}}) {
    CreditWindow credit(10ms);
    const TimePoint start = TimePoint{} + 1h;
    EXPECT_EQ(credit.limit(), 1) << "nothing is known before the first acknowledgement";
    credit.sent({1, 1000, 100, start});
    EXPECT_TRUE(credit.acknowledged(1, false, start + rtt));
    EXPECT_EQ(credit.limit(), limit) << rtt.count();
  }
}

TEST(CreditWindow, APresentedFrameSettlesOlderOnes) {
  CreditWindow credit(16ms);
  TimePoint now = TimePoint{} + 1h;
  for (std::uint64_t id = 1; id <= 4; ++id) credit.sent({id, 1000, 100, now});
  EXPECT_TRUE(credit.acknowledged(2, true, now));
  EXPECT_EQ(credit.in_flight(), 3);
  EXPECT_TRUE(credit.acknowledged(3, false, now + 1ms));
  EXPECT_EQ(credit.in_flight(), 1);
  EXPECT_FALSE(credit.acknowledged(1, false, now + 2ms)) << "settled already";
  EXPECT_FALSE(credit.acknowledged(99, false, now + 2ms)) << "never sent";
  EXPECT_EQ(credit.in_flight(), 1);
}

TEST(CreditWindow, ForgetsAnOldMinimum) {
  CreditWindow credit(10ms);
  TimePoint now = TimePoint{} + 1h;
  std::uint64_t id = 0;
  const auto round_trip = [&](std::chrono::milliseconds rtt) {
    credit.sent({++id, 1000, 100, now});
    now += rtt;
    credit.acknowledged(id, false, now);
  };
  round_trip(5ms);
  EXPECT_EQ(credit.base_rtt(), 5ms);
  for (int i = 0; i < 300; ++i) round_trip(40ms);  // twelve seconds on a longer path
  EXPECT_EQ(credit.base_rtt(), 40ms);
}

TEST(RateLimit, AllowsABurstAndThenItsRate) {
  TimePoint now{};
  RateLimit limit(10.0, 5.0, now);
  int taken = 0;
  while (limit.take(now)) ++taken;
  EXPECT_EQ(taken, 5);
  now += 1s;
  taken = 0;
  while (limit.take(now)) ++taken;
  EXPECT_EQ(taken, 5) << "saved up no further than the burst";
  now += 200ms;
  EXPECT_TRUE(limit.take(now));
  EXPECT_TRUE(limit.take(now));
  EXPECT_FALSE(limit.take(now));
}

TEST(FrameSize, IsEvenAndBounded) {
  EXPECT_EQ(frame_size({641, 361}, 3840 * 2160), glm::ivec2(640, 360));
  EXPECT_EQ(frame_size({16, 16}, 3840 * 2160), glm::ivec2(16, 16));
  const glm::ivec2 large = frame_size({8192, 8192}, 1920 * 1080);
  EXPECT_EQ(large.x, large.y);
  EXPECT_LE(large.x * large.y, 1920 * 1080);
  EXPECT_EQ(large.x % 2, 0);
}

}  // namespace
}  // namespace catgs
