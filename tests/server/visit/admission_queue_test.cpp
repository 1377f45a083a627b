#include "server/visit/admission_queue.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr TimePoint start{};

TEST(AdmissionQueue, FirstComeFirstServedUpToItsLimit) {
  AdmissionQueue queue(3);
  EXPECT_EQ(queue.join("a", start), 1);
  EXPECT_EQ(queue.join("b", start), 2);
  EXPECT_EQ(queue.join("c", start), 3);
  EXPECT_EQ(queue.join("d", start), std::nullopt) << "full";
  EXPECT_EQ(queue.join("b", start), 2) << "asking again moves nobody";
  queue.leave("nobody");
  queue.leave("a");
  ASSERT_EQ(queue.waiting().size(), 2u);
  EXPECT_EQ(queue.waiting().front().session_id, "b");
  EXPECT_EQ(queue.join("d", start), 3);
  queue.leave("c");
  EXPECT_EQ(queue.join("d", start), 2) << "those behind move up";
}

TEST(AdmissionQueue, NobodyWaitsWithoutRoom) {
  AdmissionQueue queue(0);
  EXPECT_EQ(queue.join("a", start), std::nullopt);
  EXPECT_TRUE(queue.empty());
}

TEST(AdmissionQueue, EstimatesByHowLongSessionsLast) {
  AdmissionQueue queue(8);
  const auto guess = queue.estimate(1, 4);
  EXPECT_GT(guess, 0s);
  EXPECT_EQ(queue.estimate(4, 4), 4 * guess);
  for (int i = 0; i < 200; ++i) queue.session_ended(60s);
  EXPECT_EQ(queue.estimate(1, 4), 16s)
      << "one of four minutes' sessions ends every 15 s, rounded up";
  EXPECT_EQ(queue.estimate(2, 4), 31s);
  EXPECT_GT(queue.estimate(1, 0), 0s);
}

}  // namespace
}  // namespace catgs
