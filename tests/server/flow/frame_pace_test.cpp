// Frames of a moving camera start with its poses, at the nominal rate on average.

#include "server/flow/frame_pace.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

struct Outcome {
  int frames = 0;
  std::chrono::microseconds longest_wait{};  // of a pose, until its frame starts
};

/// Poses that arrive this far apart, up to `jitter` late, for a session of this nominal interval
/// whose frames take `service`, looked at for ten seconds after the first.
Outcome simulate(std::chrono::microseconds poses, std::chrono::microseconds interval,
                 std::chrono::microseconds service = 8ms, std::chrono::microseconds jitter = 0us) {
  std::mt19937 random(1);
  std::uniform_int_distribution<std::int64_t> late(0, jitter.count());
  const auto arrival = [&](int pose) {
    return TimePoint{1h} + poses * pose + std::chrono::microseconds(late(random));
  };
  FramePace pace;
  Outcome outcome;
  int pose = 0;
  TimePoint shown{}, newest{}, next_pose = arrival(0), free{1h};
  for (TimePoint now{1h}; now < TimePoint{1h} + 11s; now += 100us) {
    if (now >= next_pose) {
      newest = now;
      pace.pose_arrived(interval, now);
      next_pose = arrival(++pose);
    }
    if (newest == shown || now < free || now < pace.next_start_of_pose().value_or(now)) continue;
    pace.frame_starts(interval, now);
    shown = newest;
    free = now + service;
    if (now < TimePoint{1h} + 1s) continue;
    ++outcome.frames;
    outcome.longest_wait = std::max(
        outcome.longest_wait, std::chrono::duration_cast<std::chrono::microseconds>(now - newest));
  }
  return outcome;
}

TEST(FramePaceTest, AFrameStartsWithItsPose) {
  for (const auto poses : {6944us, 8333us, 13'889us, 16'667us, 17'000us, 33'333us}) {
    for (const auto interval : {16'667us, 33'333us}) {
      const Outcome outcome = simulate(poses, interval);
      EXPECT_LE(outcome.longest_wait, 200us) << poses.count() << " us, " << interval.count();
      const double expected = 10.0e6 / static_cast<double>(std::max(poses, interval).count());
      EXPECT_NEAR(outcome.frames, expected, 2.0) << poses.count() << " us, " << interval.count();
    }
  }
}

TEST(FramePaceTest, PosesThatComeUnevenlyKeepTheRate) {
  for (const auto poses : {8333us, 13'889us, 16'667us}) {
    const Outcome outcome = simulate(poses, 33'333us, 8ms, 6ms);
    EXPECT_NEAR(outcome.frames, 300, 3) << poses.count() << " us";
    EXPECT_LE(outcome.longest_wait, poses + 6ms) << poses.count() << " us";
  }
}

TEST(FramePaceTest, APoseThatCameWhileTheLastFrameWasMadeStartsTheNextAtOnce) {
  const Outcome outcome = simulate(16'667us, 16'667us, 20ms);
  EXPECT_NEAR(outcome.frames, 500, 2);
}

TEST(FramePaceTest, PosesThatComeMeanwhileDoNotPutOffAFrameThatIsDue) {
  FramePace pace;
  TimePoint now{1h};
  for (int i = 0; i < 2; ++i) pace.frame_starts(33ms, now);
  now += 33ms;
  pace.pose_arrived(33ms, now);
  for (int i = 1; i < 100; ++i) pace.pose_arrived(33ms, now + i * 8ms);
  EXPECT_EQ(pace.next_start_of_pose(), now) << "it would starve beside sessions with fewer poses";
}

TEST(FramePaceTest, TheNewestPoseIsShownHalfAPoseLaterWhenNoneFollows) {
  FramePace pace;
  TimePoint now{1h};
  for (int i = 0; i < 100; ++i, now += 10ms) pace.pose_arrived(33ms, now);
  for (int i = 0; i < 2; ++i) pace.frame_starts(33ms, now);  // the next one is due in 33 ms
  pace.pose_arrived(33ms, now + 10ms);
  EXPECT_EQ(pace.next_start(), now + 33ms);
  EXPECT_GT(pace.next_start_of_pose(), now + 37ms);
  EXPECT_LE(pace.next_start_of_pose(), now + 39ms);
}

}  // namespace
}  // namespace catgs
