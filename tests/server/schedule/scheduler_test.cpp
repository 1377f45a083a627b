#include "server/schedule/scheduler.h"

#include <algorithm>
#include <array>

#include <gtest/gtest.h>

namespace catgs {
namespace {

using namespace std::chrono_literals;

TEST(FrameScheduler, TakesTheEarliestDeadlineOfThoseReady) {
  const TimePoint now = TimePoint{} + 1h;
  const std::array candidates = {FrameCandidate{now, now + 16ms}, FrameCandidate{now, now + 8ms},
                                 FrameCandidate{now + 1ms, now + 2ms}};
  EXPECT_EQ(FrameScheduler::choose(candidates, now), 1u);
  EXPECT_EQ(FrameScheduler::choose(candidates, now + 1ms), 2u);
  EXPECT_FALSE(FrameScheduler::choose({}, now));
}

TEST(FrameScheduler, CountsSlots) {
  FrameScheduler scheduler(2);
  scheduler.frame_started();
  EXPECT_TRUE(scheduler.has_free_slot());
  scheduler.frame_started();
  EXPECT_FALSE(scheduler.has_free_slot());
  scheduler.frame_ended();
  EXPECT_TRUE(scheduler.has_free_slot());
}

// Sessions of different nominal rates, all asking for more than the device can do: whoever started
// a frame waits until the others had theirs.
TEST(FrameScheduler, NobodyStarvesUnderOverload) {
  constexpr std::array intervals = {8ms, 16ms, 33ms, 16ms};
  std::array<TimePoint, 4> next_start{};
  std::array<int, 4> frames{};
  TimePoint now = TimePoint{} + 1h;
  next_start.fill(now);
  for (int i = 0; i < 400; ++i) {
    std::array<FrameCandidate, 4> candidates;
    for (std::size_t k = 0; k < 4; ++k)
      candidates[k] = {next_start[k], next_start[k] + intervals[k]};
    const auto chosen = FrameScheduler::choose(candidates, now);
    if (chosen) {
      ++frames[*chosen];
      next_start[*chosen] = std::max(next_start[*chosen], now - intervals[*chosen]);
      next_start[*chosen] += intervals[*chosen];
    }
    now += 50ms;  // what a frame costs
  }
  EXPECT_GE(*std::ranges::min_element(frames), 80);
}

}  // namespace
}  // namespace catgs
