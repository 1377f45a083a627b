#include "server/net/body_deadline.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr std::size_t mib = 1 << 20;

/// When a body ends that comes at this rate; nothing: the server hangs up before.
std::optional<Clock::duration> ends(std::size_t bytes, double bytes_per_s) {
  constexpr TimePoint start{};
  constexpr auto step = 100ms;
  BodyDeadline due(bytes, start);
  double came = 0.0;
  for (TimePoint now = start + step; came < static_cast<double>(bytes); now += step) {
    if (due.at() <= now) return std::nullopt;
    const double piece = bytes_per_s * std::chrono::duration<double>(step).count();
    due.arrived(static_cast<std::size_t>(piece), now);
    came += piece;
    if (came >= static_cast<double>(bytes)) return now - start;
  }
  return std::nullopt;
}

TEST(BodyDeadline, ADripEndsAfterTheGraceHoweverLongTheBodyIs) {
  constexpr TimePoint start{};
  for (const std::size_t bytes : {std::size_t{1000}, 64 * mib}) {
    BodyDeadline due(bytes, start);
    for (TimePoint now = start; now < start + 10s; now += 1s) due.arrived(1, now);
    EXPECT_LT(due.at(), start + 11s) << bytes;
  }
}

TEST(BodyDeadline, BytesThatCameEarlyPayForNoPause) {
  constexpr TimePoint start{};
  BodyDeadline due(64 * mib, start);
  due.arrived(63 * mib, start + 1s);
  EXPECT_EQ(due.at(), start + 11s);
}

TEST(BodyDeadline, AWholeBodyHasATime) {
  constexpr TimePoint start{};
  BodyDeadline due(mib, start);
  TimePoint now = start;
  for (; due.at() > now; now += 1s) due.arrived(mib, now);  // more than was announced, say
  EXPECT_EQ(due.at(), start + 38s);
}

TEST(BodyDeadline, SteadyLinesOfAMegabitFinish) {
  EXPECT_TRUE(ends(64 * mib, 128 * 1024));
  EXPECT_TRUE(ends(2 * mib, 64 * 1024));
  EXPECT_TRUE(ends(20'000, 2 * 1024)) << "a sidecar over a telephone";
  EXPECT_FALSE(ends(64 * mib, 60 * 1024));
  EXPECT_FALSE(ends(2 * mib, 16 * 1024));
}

}  // namespace
}  // namespace catgs
