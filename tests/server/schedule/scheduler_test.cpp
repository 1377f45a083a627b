#include "server/schedule/scheduler.h"

#include "server/schedule/next_frame_cost.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

/// Somebody who offers a frame, and counts how often that was asked.
struct Source {
  Source(std::optional<FrameCandidate> offer = {}) : frame(offer) {}
  [[nodiscard]] std::optional<FrameCandidate> next_frame() const {
    ++asked;
    return frame;
  }
  std::optional<FrameCandidate> frame;
  mutable int asked = 0;
};
using Scheduler = FrameScheduler<Source>;

const TimePoint now = TimePoint{} + 1h;

/// Whose turn it is; null: nobody's.
const Source* take(Scheduler& scheduler, TimePoint at) {
  const auto turn = scheduler.take(at);
  return turn ? &turn->source : nullptr;
}

/// Who of these would be chosen first.
const Source* first_of(Scheduler& scheduler, std::initializer_list<Source*> sources, TimePoint at) {
  for (Source* source : sources) scheduler.changed(*source, at);
  const auto turn = scheduler.take(at);
  for (Source* source : sources) scheduler.withdraw(*source);
  if (!turn) return nullptr;
  scheduler.frame_ended(turn->frame);
  return &turn->source;
}

/// Starts a frame as if it was the only one.
void run(Scheduler& scheduler, Source source) {
  scheduler.changed(source, now);
  EXPECT_TRUE(scheduler.take(now));
}

TEST(FrameScheduler, TakesTheEarliestDeadlineOfThoseReady) {
  Scheduler scheduler(3);
  Source late{FrameCandidate{now, now + 16ms}};
  Source soon{FrameCandidate{now, now + 8ms}};
  Source not_ready{FrameCandidate{now + 1ms, now + 2ms}};
  for (Source* source : {&late, &soon, &not_ready}) scheduler.changed(*source, now);
  EXPECT_EQ(scheduler.next_ready(), now + 1ms);
  EXPECT_EQ(take(scheduler, now), &soon);
  EXPECT_EQ(take(scheduler, now + 1ms), &not_ready);
  EXPECT_EQ(take(scheduler, now + 1ms), &late);
  EXPECT_EQ(take(scheduler, now + 1ms), nullptr);
  EXPECT_FALSE(scheduler.next_ready());
}

TEST(FrameScheduler, LongerFramesStartEarlier) {
  Scheduler scheduler(1);
  Source quick{FrameCandidate{now, now + 10ms, 2ms}};
  Source slow{FrameCandidate{now, now + 12ms, 8ms}};
  EXPECT_EQ(first_of(scheduler, {&quick, &slow}, now), &slow);
}

TEST(FrameScheduler, CountsSlots) {
  Scheduler scheduler(2);
  Source source{FrameCandidate{now, now}};
  run(scheduler, source);
  EXPECT_TRUE(scheduler.has_free_slot());
  run(scheduler, source);
  EXPECT_FALSE(scheduler.has_free_slot());
  scheduler.changed(source, now);
  EXPECT_EQ(take(scheduler, now), nullptr);
  scheduler.frame_ended(*source.frame);
  EXPECT_EQ(take(scheduler, now), &source);
}

TEST(FrameScheduler, FollowsANumberOfSlotsThatChanges) {
  Scheduler scheduler(1);
  Source source{FrameCandidate{now, now}};
  run(scheduler, source);
  EXPECT_FALSE(scheduler.has_free_slot());
  scheduler.set_slots(2);
  run(scheduler, source);
  scheduler.set_slots(1);
  scheduler.frame_ended(*source.frame);
  EXPECT_FALSE(scheduler.has_free_slot());
}

TEST(FrameScheduler, AChangeAsksNobodyElse) {
  std::vector<Source> sources(1000);
  Scheduler scheduler(2);
  for (Source& source : sources) scheduler.changed(source, now);
  for (Source& source : sources) source.asked = 0;
  sources[7].frame = FrameCandidate{now, now + 16ms};
  scheduler.changed(sources[7], now);
  EXPECT_EQ(take(scheduler, now), &sources[7]);
  EXPECT_LE(std::exchange(sources[7].asked, 0), 2);
  EXPECT_TRUE(std::ranges::all_of(sources, [](const Source& source) { return source.asked == 0; }));
}

TEST(FrameScheduler, StartsWhatASourceOffersNow) {
  Scheduler scheduler(3);
  Source source{FrameCandidate{now, now + 16ms}};
  scheduler.changed(source, now);
  source.frame.reset();
  EXPECT_EQ(take(scheduler, now), nullptr) << "it changed its mind, and told nobody";
  source.frame = FrameCandidate{now, now + 16ms};
  scheduler.changed(source, now);
  source.frame->ready = now + 5ms;
  scheduler.changed(source, now);
  EXPECT_EQ(take(scheduler, now + 4ms), nullptr);
  EXPECT_EQ(take(scheduler, now + 5ms), &source);
  EXPECT_EQ(take(scheduler, now + 5ms), nullptr) << "until it offers another";
}

TEST(FrameScheduler, KnowsSinceWhenAFrameCouldHaveStarted) {
  Scheduler scheduler(2);
  Source source{FrameCandidate{now + 2ms, now + 16ms}};
  scheduler.changed(source, now);
  source.frame->ready = now + 3ms;  // another pose: still the same wait
  scheduler.changed(source, now + 2ms);
  EXPECT_EQ(scheduler.take(now + 9ms)->ready, now + 2ms);
  scheduler.changed(source, now + 10ms);
  EXPECT_EQ(scheduler.take(now + 11ms)->ready, now + 10ms);
}

TEST(FrameScheduler, ADeviceThatCannotKeepUpLeavesTheOthersTheirSlots) {
  Scheduler scheduler(5, 2);
  Source late{FrameCandidate{now, now - 100ms, 10ms, 0}};
  Source punctual{FrameCandidate{now, now + 16ms, 3ms, 1}};
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(first_of(scheduler, {&punctual, &late}, now), &late);
    run(scheduler, late);
  }
  EXPECT_TRUE(scheduler.has_free_slot());
  EXPECT_EQ(first_of(scheduler, {&punctual, &late}, now), &punctual);
  EXPECT_EQ(first_of(scheduler, {&late}, now), nullptr);
  scheduler.frame_ended(*late.frame);
  EXPECT_EQ(first_of(scheduler, {&late}, now), &late);
}

// Against the plain search through all of them.
TEST(FrameScheduler, ChoosesAsASearchThroughAllWould) {
  std::mt19937 random(1);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  constexpr int slots = 6, devices = 2;
  Scheduler scheduler(slots, devices);
  std::vector<Source> sources(50);
  std::vector<FrameCandidate> running;
  TimePoint at = now;
  const auto search = [&]() -> const Source* {
    const Source* best = nullptr;
    for (const Source& source : sources) {
      const auto& frame = source.frame;
      const auto on_device = [&](const auto& r) { return r.device == frame->device; };
      if (!frame || frame->ready > at || std::ssize(running) == slots ||
          std::ranges::count_if(running, on_device) == slots / devices)
        continue;
      if (!best || frame->latest_start() < best->frame->latest_start()) best = &source;
    }
    return best;
  };
  int taken = 0;
  for (int step = 0; step < 5000; ++step) {
    at += 1us * below(2000);
    Source& source = sources[random() % sources.size()];
    if (below(5) == 0)
      source.frame.reset();
    else  // with the step in it, so that no two are equal
      source.frame = FrameCandidate{at + 1us * below(4000), at + 1us * below(20'000) + 1ns * step,
                                    1us * below(9000), below(devices)};
    scheduler.changed(source, at);
    if (!running.empty() && below(3) > 0) {
      scheduler.frame_ended(running.back());
      running.pop_back();
    }
    const Source* const expected = search();
    ASSERT_EQ(take(scheduler, at), expected) << step;
    if (!expected) continue;
    ++taken;
    Source& chosen = sources[static_cast<std::size_t>(expected - sources.data())];
    running.push_back(*chosen.frame);
    chosen.frame.reset();
  }
  EXPECT_GT(taken, 1000);
}

/// Sessions on one device in simulated time.
struct Overload {
  struct Load {
    Clock::duration interval;
    Clock::duration cost;
    TimePoint next_start{};
    bool busy = false;
    int frames = 0;

    [[nodiscard]] std::optional<FrameCandidate> next_frame() const {
      if (busy) return std::nullopt;
      return FrameCandidate{next_start, next_start + interval, cost, 0};
    }
  };
  struct Running {
    Load* session;
    FrameCandidate frame;
    TimePoint end;
  };

  FrameScheduler<Load> scheduler{2};
  std::vector<Load> loads;
  std::vector<Running> running;

  void run(Clock::duration duration) {
    TimePoint time = now;
    for (Load& load : loads) {
      load.next_start = now;
      scheduler.changed(load, time);
    }
    for (; time < now + duration; time += 500us) {
      std::erase_if(running, [&](const Running& r) {
        if (r.end > time) return false;
        scheduler.frame_ended(r.frame);
        r.session->busy = false;
        ++r.session->frames;
        scheduler.changed(*r.session, time);
        return true;
      });
      while (const auto turn = scheduler.take(time)) {
        Load& load = turn->source;
        load.busy = true;
        load.next_start = std::max(load.next_start, time - load.interval) + load.interval;
        running.push_back({&load, turn->frame, time + turn->frame.cost});
      }
    }
  }
};

// Eight sessions at 60 Hz want twice what two slots give, some of them with dearer frames.
TEST(FrameScheduler, IsFairUnderTwiceTheLoad) {
  Overload overload;
  for (int i = 0; i < 8; ++i) overload.loads.push_back({16'667us, 6ms + i * 1ms});
  overload.run(20s);
  const auto [least, most] = std::ranges::minmax(overload.loads, {}, &Overload::Load::frames);
  EXPECT_LE(most.frames, 1.2 * least.frames);
  EXPECT_GT(least.frames, 20 * 20) << "and the slots are used";
}

// Sessions of different nominal rates, all asking for more than the device can do.
TEST(FrameScheduler, NobodyStarvesUnderOverload) {
  Overload overload;
  for (const auto interval : {8ms, 16ms, 33ms, 16ms}) overload.loads.push_back({interval, 60ms});
  overload.run(20s);
  const auto [least, most] = std::ranges::minmax(overload.loads, {}, &Overload::Load::frames);
  EXPECT_LE(most.frames, 1.2 * least.frames);
}

TEST(NextFrameCost, TellsFramesInMotionFromStills) {
  NextFrameCost cost;
  EXPECT_EQ(cost.next(), 0ms);
  FrameTicket ticket;
  const auto add = [&](Clock::duration render, Clock::duration encode) {
    const TimePoint rendered = TimePoint{} + render;
    ticket.render = {TimePoint{}, rendered};
    ticket.encode = {rendered, rendered + encode};
    cost.add(ticket);
  };
  add(10ms, 4ms);
  EXPECT_EQ(cost.next(), 14ms);
  add(18ms, 4ms);
  EXPECT_EQ(cost.next(), 15ms) << "smoothed";
  EXPECT_EQ(cost.still(), 15ms) << "of the same size, as far as is known";
  EXPECT_EQ(cost.refinement(), 4ms);
  ticket.still = true;
  add(40ms, 20ms);
  ticket.refined = true;
  add(0ms, 15ms);
  EXPECT_EQ(cost.still(), 60ms);
  EXPECT_EQ(cost.refinement(), 15ms);
  EXPECT_EQ(cost.next(), 15ms) << "of another size";
}

}  // namespace
}  // namespace catgs
