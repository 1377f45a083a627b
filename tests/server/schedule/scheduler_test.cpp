#include "server/schedule/scheduler.h"

#include <algorithm>
#include <array>
#include <vector>

#include <gtest/gtest.h>

#include "server/schedule/next_frame_cost.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

TEST(FrameScheduler, TakesTheEarliestDeadlineOfThoseReady) {
  const TimePoint now = TimePoint{} + 1h;
  const FrameScheduler scheduler(1);
  const std::array candidates = {FrameCandidate{now, now + 16ms}, FrameCandidate{now, now + 8ms},
                                 FrameCandidate{now + 1ms, now + 2ms}};
  EXPECT_EQ(scheduler.choose(candidates, now), 1u);
  EXPECT_EQ(scheduler.choose(candidates, now + 1ms), 2u);
  EXPECT_FALSE(scheduler.choose({}, now));
}

TEST(FrameScheduler, WhatTakesLongerStartsEarlier) {
  const TimePoint now = TimePoint{} + 1h;
  const std::array candidates = {FrameCandidate{now, now + 10ms, 2ms},
                                 FrameCandidate{now, now + 12ms, 8ms}};
  EXPECT_EQ(FrameScheduler(1).choose(candidates, now), 1u);
}

TEST(FrameScheduler, CountsSlots) {
  FrameScheduler scheduler(2);
  const FrameCandidate frame;
  scheduler.frame_started(frame);
  EXPECT_TRUE(scheduler.has_free_slot());
  scheduler.frame_started(frame);
  EXPECT_FALSE(scheduler.has_free_slot());
  scheduler.frame_ended(frame);
  EXPECT_TRUE(scheduler.has_free_slot());
}

TEST(FrameScheduler, KeyFramesOfADeviceMakeWayForSubFramesWhileTheyCan) {
  const TimePoint now = TimePoint{} + 1h;
  FrameScheduler scheduler(4);
  const FrameCandidate key{now, now + 16ms, 10ms, true, 0};
  const FrameCandidate other_device{now, now + 17ms, 10ms, true, 1};
  const FrameCandidate sub{now, now + 16ms, 3ms, false, 0};
  EXPECT_EQ(scheduler.choose(std::array{sub, key}, now), 1u);
  scheduler.frame_started(key);
  EXPECT_EQ(scheduler.choose(std::array{sub, key}, now), 0u);
  EXPECT_EQ(scheduler.choose(std::array{sub, key}, now + 6ms), 1u) << "it can wait no longer";
  EXPECT_EQ(scheduler.choose(std::array{key}, now), 0u) << "no slot stays empty";
  EXPECT_EQ(scheduler.choose(std::array{sub, other_device}, now), 1u);
  scheduler.frame_ended(key);
  EXPECT_EQ(scheduler.choose(std::array{sub, key}, now), 1u);
}

TEST(FrameScheduler, ADeviceThatCannotKeepUpLeavesTheOthersTheirSlots) {
  const TimePoint now = TimePoint{} + 1h;
  FrameScheduler scheduler(5, 2);
  const FrameCandidate late{now, now - 100ms, 10ms, false, 0};
  const FrameCandidate punctual{now, now + 16ms, 3ms, false, 1};
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(scheduler.choose(std::array{punctual, late}, now), 1u);
    scheduler.frame_started(late);
  }
  EXPECT_TRUE(scheduler.has_free_slot());
  EXPECT_EQ(scheduler.choose(std::array{punctual, late}, now), 0u);
  EXPECT_EQ(scheduler.choose(std::array{late}, now), std::nullopt);
  scheduler.frame_ended(late);
  EXPECT_EQ(scheduler.choose(std::array{late}, now), 0u);
}

/// Sessions on one device in simulated time.
struct Overload {
  struct Load {
    Clock::duration interval;
    Clock::duration key_cost, sub_cost;
    TimePoint next_start{};
    int window_left = 0;
    bool busy = false;
    int frames = 0;
  };
  struct Running {
    std::size_t session;
    FrameCandidate frame;
    TimePoint end;
  };

  FrameScheduler scheduler{2};
  std::vector<Load> loads;
  std::vector<Running> running;
  TimePoint now = TimePoint{} + 1h;

  [[nodiscard]] FrameCandidate candidate(const Load& load) const {
    const bool key = load.window_left == 0;
    return {load.next_start, load.next_start + load.interval, key ? load.key_cost : load.sub_cost,
            key, 0};
  }

  void start_frames() {
    while (scheduler.has_free_slot()) {
      std::vector<FrameCandidate> candidates;
      std::vector<std::size_t> owners;
      for (std::size_t i = 0; i < loads.size(); ++i) {
        if (loads[i].busy) continue;
        candidates.push_back(candidate(loads[i]));
        owners.push_back(i);
      }
      const auto chosen = scheduler.choose(candidates, now);
      if (!chosen) return;
      Load& load = loads[owners[*chosen]];
      load.busy = true;
      load.window_left = load.window_left == 0 ? 4 : load.window_left - 1;
      load.next_start = std::max(load.next_start, now - load.interval) + load.interval;
      scheduler.frame_started(candidates[*chosen]);
      running.push_back({owners[*chosen], candidates[*chosen], now + candidates[*chosen].cost});
    }
  }

  void run(Clock::duration duration) {
    const TimePoint end = now + duration;
    for (Load& load : loads) load.next_start = now;
    for (; now < end; now += 500us) {
      std::erase_if(running, [&](const Running& r) {
        if (r.end > now) return false;
        scheduler.frame_ended(r.frame);
        loads[r.session].busy = false;
        ++loads[r.session].frames;
        return true;
      });
      start_frames();
    }
  }
};

// Eight sessions at 60 Hz want twice what two slots give, some of them with dearer frames.
TEST(FrameScheduler, IsFairUnderTwiceTheLoad) {
  Overload overload;
  for (int i = 0; i < 8; ++i) overload.loads.push_back({16'667us, 15ms + i * 1ms, 4ms + i * 1ms});
  overload.run(20s);
  const auto [least, most] = std::ranges::minmax(overload.loads, {}, &Overload::Load::frames);
  EXPECT_LE(most.frames, 1.2 * least.frames);
  EXPECT_GT(least.frames, 20 * 20) << "and the slots are used";
}

// Sessions of different nominal rates, all asking for more than the device can do.
TEST(FrameScheduler, NobodyStarvesUnderOverload) {
  Overload overload;
  for (const auto interval : {8ms, 16ms, 33ms, 16ms})
    overload.loads.push_back({interval, 100ms, 50ms});
  overload.run(20s);
  const auto [least, most] = std::ranges::minmax(overload.loads, {}, &Overload::Load::frames);
  EXPECT_LE(most.frames, 1.2 * least.frames);
}

TEST(NextFrameCost, TellsKeyFramesFromSubFrames) {
  NextFrameCost cost;
  EXPECT_EQ(cost.next(), 0ms);
  EXPECT_TRUE(cost.key_is_next());
  FrameTicket ticket;
  const auto add = [&](Clock::duration render, Clock::duration encode) {
    const TimePoint rendered = TimePoint{} + render;
    ticket.render = {TimePoint{}, rendered};
    ticket.encode = {rendered, rendered + encode};
    cost.add(ticket);
  };
  ticket.window = 2;
  add(10ms, 4ms);
  EXPECT_FALSE(cost.key_is_next());
  ticket.speculated = true;
  add(3ms, 4ms);
  EXPECT_EQ(cost.next(), 7ms);
  EXPECT_FALSE(cost.key_is_next());
  add(3ms, 4ms);
  EXPECT_TRUE(cost.key_is_next());
  EXPECT_EQ(cost.next(), 14ms);
  EXPECT_EQ(cost.still(), 14ms) << "of the same size, as far as is known";
  EXPECT_EQ(cost.refinement(), 4ms);
  ticket.still = true;
  add(40ms, 20ms);
  ticket.refined = true;
  add(0ms, 15ms);
  EXPECT_EQ(cost.still(), 60ms);
  EXPECT_EQ(cost.refinement(), 15ms);
  EXPECT_TRUE(cost.key_is_next());
  EXPECT_EQ(cost.next(), 14ms) << "of another size";
}

}  // namespace
}  // namespace catgs
