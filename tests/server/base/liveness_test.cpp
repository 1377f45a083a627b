#include "server/base/liveness.h"

#include <cstdlib>
#include <new>

#include <unistd.h>

#include "server/base/watchdog.h"
#include "tests/support/test.h"

namespace {

/// How many more times this thread gets memory.
thread_local int allocations_left = -1;  // negative: always

}  // namespace

// Inlined, GCC takes one for that of another's pair.
[[gnu::noinline]] void* operator new(std::size_t bytes) {
  if (allocations_left == 0) throw std::bad_alloc();
  if (allocations_left > 0) --allocations_left;
  if (void* memory = std::malloc(bytes)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept { return std::malloc(bytes); }
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace catgs {
namespace {

/// At a time that passes when the test says so.
struct LivenessTest : testing::Test {
  Clock::duration now = 1h;
  Liveness liveness{[this] { return TimePoint(now); }};
};

TEST_F(LivenessTest, NamesTheSessionThreadAfterTenSeconds) {
  EXPECT_EQ(liveness.complaint(), "");
  now = 1h + 10s;
  EXPECT_EQ(liveness.complaint(), "");
  now = 1h + 11s;
  EXPECT_EQ(liveness.complaint(), "session stalled for 11 s");
  liveness.session_moved();
  EXPECT_EQ(liveness.complaint(), "");
}

TEST_F(LivenessTest, TheOldestFrameUnderWayTells) {
  auto first = liveness.frame_started();
  now = 1h + 20s;
  auto second = liveness.frame_started();
  liveness.session_moved();
  now = 1h + 30s;
  EXPECT_EQ(liveness.complaint(), "");
  now = 1h + 31s;
  EXPECT_EQ(liveness.complaint(), "session stalled for 11 s, frames stalled for 31 s");
  first.reset();
  liveness.session_moved();
  EXPECT_EQ(liveness.complaint(), "");
  now = 1h + 51s;
  liveness.session_moved();
  EXPECT_EQ(liveness.complaint(), "frames stalled for 31 s");
  second.reset();
  EXPECT_EQ(liveness.complaint(), "");
}

/// In a process of its own, which a mutex that is never let go would stop for good.
TEST_F(LivenessTest, AFrameThatFindsNoMemoryIsForgotten) {
  const auto start_frames = [&] {
    ::alarm(20);
    int failed = 0;
    for (std::shared_ptr<const void> frame; !frame;) {
      allocations_left = failed;
      try {
        frame = liveness.frame_started();
      } catch (const std::bad_alloc&) {
        ++failed;
      }
    }
    allocations_left = -1;
    now = 1h + 31s;
    liveness.session_moved();
    std::_Exit(failed > 0 && liveness.complaint().empty() ? 0 : 1);
  };
  EXPECT_EXIT(start_frames(), testing::ExitedWithCode(0), "");
}

TEST_F(LivenessTest, TheWatchdogGivesUpWhatStaysStalled) {
  now = 2h;
  std::promise<std::string> why;
  const Watchdog watchdog(
      liveness, [&](const std::string& text) { why.set_value(text); }, 1ms);
  EXPECT_EQ(why.get_future().get(), "session stalled for 3600 s");
}

TEST_F(LivenessTest, TheWatchdogForgetsWhatHasPassed) {
  std::atomic<int> looks{0};
  Liveness recovers([&] {
    // Stalled in all but one of each sixty rounds.
    const int look = looks++;
    return TimePoint(look % Watchdog::rounds == 0 ? 1h : 2h);
  });
  {
    std::atomic<bool> gave_up{false};
    const Watchdog watchdog(
        recovers, [&](const std::string&) { gave_up = true; }, 1ms);
    while (looks < 3 * Watchdog::rounds && !gave_up) std::this_thread::yield();
    EXPECT_FALSE(gave_up);
  }
}

}  // namespace
}  // namespace catgs
