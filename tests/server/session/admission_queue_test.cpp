#include "server/session/admission_queue.h"

#include <gtest/gtest.h>

namespace catgs {
namespace {

using namespace std::chrono_literals;

TEST(AdmissionQueue, FirstComeFirstServedUpToItsLimit) {
  AdmissionQueue queue(3);
  EXPECT_EQ(queue.join("a"), 1);
  EXPECT_EQ(queue.join("b"), 2);
  EXPECT_EQ(queue.join("c"), 3);
  EXPECT_EQ(queue.join("d"), std::nullopt) << "full";
  EXPECT_EQ(queue.join("b"), 2) << "asking again moves nobody";
  queue.leave("nobody");
  queue.leave("a");
  EXPECT_EQ(queue.front(), "b");
  EXPECT_EQ(queue.join("d"), 3);
  queue.leave("c");
  EXPECT_EQ(queue.join("d"), 2) << "those behind move up";
}

TEST(AdmissionQueue, NobodyWaitsWithoutRoom) {
  AdmissionQueue queue(0);
  EXPECT_EQ(queue.join("a"), std::nullopt);
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
