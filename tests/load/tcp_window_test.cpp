#include "tests/load/tcp_window.h"

#include <deque>

#include "tests/support/test.h"

namespace catgs::load {
namespace {

constexpr std::int64_t round_trip_us = 100'000;

/// A sender on a line without loss, except for what the test loses.
struct Sender {
  TcpWindow window;
  std::int64_t now_us = 0;
  std::deque<std::int64_t> under_way;  // when each was sent

  /// Sends what the window allows, at most `most` under way, and hears of it a round trip later.
  void round(double most = 1e9) {
    const std::int64_t sent_us = now_us;
    while (window.in_flight() + 1.0 <= std::min(most, window.segments())) {
      window.sent(sent_us);
      under_way.push_back(sent_us);
    }
    now_us += round_trip_us;
    for (; !under_way.empty(); under_way.pop_front()) window.acked(under_way.front(), now_us);
  }
  /// A round in which the first segment is lost.
  void lose() {
    const std::int64_t sent_us = now_us;
    window.lost(sent_us, now_us + round_trip_us);
    round();
  }
  /// Rounds until the window has this size.
  int rounds_to(double segments) {
    int rounds = 0;
    for (; window.segments() < segments && rounds < 1000; ++rounds) round();
    return rounds;
  }
};

TEST(TcpWindow, DoublesInSlowStart) {
  Sender sender;
  for (const double expected : {20.0, 40.0, 80.0}) {
    sender.round();
    EXPECT_EQ(sender.window.segments(), expected);
  }
}

TEST(TcpWindow, KeepsSevenTenthsAfterALossHoweverManyOfARoundTrip) {
  Sender sender;
  sender.rounds_to(80.0);
  const std::int64_t sent_us = sender.now_us;
  for (int i = 0; i < 5; ++i) sender.window.lost(sent_us, sent_us + round_trip_us);
  EXPECT_DOUBLE_EQ(sender.window.segments(), 56.0);
  EXPECT_FALSE(sender.window.slow_start());
  sender.window.lost(sent_us + 2 * round_trip_us, sent_us + 3 * round_trip_us);
  EXPECT_DOUBLE_EQ(sender.window.segments(), 0.7 * 56.0) << "a later one counts again";
}

TEST(TcpWindow, IsBackAfterTheTimeThatCubicTakes) {
  Sender sender;
  sender.rounds_to(1280.0);
  const double before = sender.window.segments();
  sender.lose();
  // W(t) = C (t - K)^3 + W_max is at 0.99 W_max so long after the loss.
  const double expected_s = std::cbrt(0.3 * before / 0.4) - std::cbrt(0.01 * before / 0.4);
  EXPECT_NEAR(0.1 * sender.rounds_to(0.99 * before), expected_s, 0.05 * expected_s);
  const double there = sender.window.segments();
  for (int i = 0; i < 10; ++i) sender.round();
  EXPECT_LT(sender.window.segments(), 1.02 * there) << "carefully near its former size";
  for (int i = 0; i < 200; ++i) sender.round();
  EXPECT_GT(sender.window.segments(), 2.0 * there) << "and boldly beyond";
}

TEST(TcpWindow, GrowsLikeRenoWhereThatIsFaster) {
  Sender sender;
  sender.rounds_to(20.0);
  sender.lose();
  const double after = sender.window.segments();
  for (int i = 0; i < 10; ++i) sender.round();
  EXPECT_NEAR(sender.window.segments(), after + 10 * 0.53, 1.5);
}

TEST(TcpWindow, BeginsWithOneSegmentAfterATimeout) {
  Sender sender;
  sender.rounds_to(80.0);
  sender.window.timed_out(sender.now_us);
  EXPECT_EQ(sender.window.segments(), 1.0);
  EXPECT_TRUE(sender.window.slow_start());
  sender.round();
  EXPECT_EQ(sender.window.segments(), 2.0);
  sender.rounds_to(56.0);
  EXPECT_FALSE(sender.window.slow_start()) << "up to seven tenths of what it was";
}

TEST(TcpWindow, RestartsAfterIdleTime) {
  Sender sender;
  sender.rounds_to(160.0);
  sender.now_us += sender.window.timeout_us() / 2;
  sender.round(1.0);
  EXPECT_EQ(sender.window.segments(), 160.0) << "a short pause";
  sender.now_us += 60'000'000;
  sender.round(1.0);
  EXPECT_EQ(sender.window.segments(), TcpWindow::initial_segments);
  EXPECT_TRUE(sender.window.slow_start()) << "it is soon back";
}

TEST(TcpWindow, AnUnusedWindowDoesNotGrow) {
  Sender sender;
  for (int i = 0; i < 50; ++i) sender.round(4.0);
  EXPECT_EQ(sender.window.segments(), 10.0);
}

}  // namespace
}  // namespace catgs::load
