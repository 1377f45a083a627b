#include "server/visit/encoder_effort.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr glm::ivec2 full_hd(1920, 1080);
constexpr int ultrafast = 0, superfast = 2;

/// Sessions whose encoders cost what their presets say, on a machine with other work too.
class EffortControlTest : public testing::Test {
 protected:
  /// They have come one by one when there was room; each has as many threads as there will be.
  void add(int count, double cpus_at_ultrafast) {
    const int all = static_cast<int>(sessions.size()) + count;
    for (int i = 0; i < count; ++i) {
      sessions.push_back(
          {.effort = {superfast, control.initial(all, full_hd).threads}, .size_px = full_hd});
      base_cpus.push_back(cpus_at_ultrafast);
    }
  }
  double cpus(std::size_t i) const {
    return base_cpus[i] * effort_presets[static_cast<std::size_t>(sessions[i].effort.preset)].cost;
  }
  double busy() const {
    double sum = other_cpus;
    for (std::size_t i = 0; i < sessions.size(); ++i) sum += cpus(i);
    return std::min(1.0, sum / cpu_count);
  }
  /// Runs for so long; returns how often something was changed.
  int run(std::chrono::milliseconds duration) {
    int changes = 0;
    for (const TimePoint end = now + duration; now < end; now += 250ms) {
      for (std::size_t i = 0; i < sessions.size(); ++i) {
        sessions[i].cpus = cpus(i);
        sessions[i].share_of_interval = cpus(i) / sessions[i].effort.threads;
      }
      for (const auto& [session, effort] :
           control.update(busy(), static_cast<int>(sessions.size()), sessions, now)) {
        sessions[session].effort = effort;
        ++changes;
      }
    }
    return changes;
  }
  int count(int preset) const {
    return static_cast<int>(std::ranges::count_if(
        sessions, [&](const auto& session) { return session.effort.preset == preset; }));
  }

  static constexpr int cpu_count = 16;
  EffortControl control{cpu_count, {}};
  std::vector<EffortControl::Session> sessions;
  std::vector<double> base_cpus;
  double other_cpus = 0.0;
  TimePoint now = TimePoint{} + 1h;
};

TEST_F(EffortControlTest, LargePicturesAreCutInTwoWhereSessionsAreFewerThanProcessors) {
  EXPECT_EQ(control.initial(1, full_hd).threads, 2) << "no more slices";
  EXPECT_EQ(control.initial(8, full_hd).threads, 2);
  EXPECT_EQ(control.initial(9, full_hd).threads, 2) << "rounded up";
  EXPECT_EQ(control.initial(16, full_hd).threads, 1);
  EXPECT_EQ(control.initial(0, full_hd).threads, 2);
  EXPECT_EQ(control.initial(1, {1280, 720}).threads, 1);
  EXPECT_EQ(control.initial(1, {332, 720}).threads, 1);
}

TEST_F(EffortControlTest, ThreadsFollowTheNumberOfSessionsOneAtATime) {
  other_cpus = 4.0;  // neither busy nor calm
  add(2, 0.3);
  run(1s);
  EXPECT_EQ(sessions[0].effort.threads, 2);
  add(14, 0.1);
  run(900ms);
  EXPECT_EQ(sessions[0].effort.threads, 1);
  EXPECT_EQ(sessions[1].effort.threads, 2) << "not both at once: each change is an IDR";
  run(10s);
  for (const auto& session : sessions) EXPECT_EQ(session.effort.threads, 1);
  EXPECT_EQ(run(30s), 0) << "and there it stays";
}

TEST_F(EffortControlTest, EncodersThatKeepAllBusyGoFasterUntilTheyFit) {
  add(30, 0.17);  // 9.7 processors at superfast, 5.1 at ultrafast
  EXPECT_EQ(run(1s), 0) << "a second of it may be chance";
  run(4s);
  EXPECT_LE(busy(), 0.55) << "who waits for all of them, one by one, loses frames";
  EXPECT_GT(busy(), 0.48) << "no more than needed";
  EXPECT_GT(count(superfast), 0);
  EXPECT_EQ(run(10min), 0) << "it does not flap";
}

TEST_F(EffortControlTest, BusyProcessorsDoNotWaitForStreamsThatAreCutAnew) {
  for (int come = 0; come < 30; come += 3) add(3, 0.17);  // with more threads than are left for 30
  ASSERT_NE(sessions[0].effort.threads, 1);
  run(5s);
  EXPECT_LE(busy(), 0.55);
  run(30s);
  for (const auto& session : sessions) EXPECT_EQ(session.effort.threads, 1);
}

TEST_F(EffortControlTest, RenderingThatKeepsAllBusyIsNoReasonForAWorsePicture) {
  other_cpus = 14.0;
  add(10, 0.25);
  ASSERT_EQ(busy(), 1.0);
  EXPECT_EQ(run(60s), 0);
}

TEST_F(EffortControlTest, HeadroomGivesQualityBack) {
  add(48, 0.25);
  run(60s);
  sessions.resize(12);  // the others leave
  base_cpus.resize(12);
  ASSERT_LT(count(superfast), 12);
  const int before = count(superfast);
  run(4s);
  EXPECT_EQ(count(superfast), before) << "room has to last";
  run(60s);
  EXPECT_EQ(count(superfast), 12);
  EXPECT_LE(busy(), 0.5);
  EXPECT_EQ(run(10min), 0);
}

TEST_F(EffortControlTest, NoSlowerThanHalfOfTheTimeBetweenFrames) {
  add(16, 0.4);  // 0.56 of the interval with the next one
  for (auto& session : sessions) session.effort.preset = ultrafast;
  EXPECT_EQ(run(60s), 0);
}

TEST_F(EffortControlTest, AnEncoderThatCannotKeepUpGoesFasterThoughOthersRest) {
  add(9, 0.2);
  base_cpus[3] = 1.2;  // in two slices: 0.6 of the interval at ultrafast, 0.84 with the next one
  run(5s);
  EXPECT_EQ(sessions[3].effort.preset, ultrafast);
  EXPECT_EQ(count(superfast), 8);
}

TEST_F(EffortControlTest, APresetThatDidNotHoldIsTriedLessOften) {
  add(30, 0.15);
  const auto tries = [&](std::chrono::minutes span) {
    int rises = 0;
    for (const TimePoint end = now + span; now < end;) {
      const int before = count(superfast);
      other_cpus = before > 0 ? 9.0 : 0.0;  // as soon as one tries, others need the machine
      run(250ms);
      rises += count(superfast) > before ? 1 : 0;
    }
    return rises;
  };
  const int first = tries(2min);
  (void)tries(4min);
  const int later = tries(2min);
  EXPECT_GE(first, 2);
  EXPECT_LT(later, first);
}

TEST(EffortControl, AFixedPresetStays) {
  EffortControl control(2, {ultrafast, ultrafast});
  EXPECT_EQ(control.initial(1, full_hd).preset, ultrafast);
  EffortControl::Session session{{ultrafast, 2}, 0.1, 0.05, full_hd};
  TimePoint now = TimePoint{} + 1h;
  for (int i = 0; i < 400; ++i, now += 250ms)
    EXPECT_TRUE(control.update(0.1, 1, std::span(&session, 1), now).empty());
}

TEST(EffortControl, FixedThreadsStay) {
  EffortControl control(8, {.threads = 1});
  EXPECT_EQ(control.initial(1, full_hd).threads, 1);
  EffortControl::Session session{{superfast, 1}, 0.1, 0.05, full_hd};
  TimePoint now = TimePoint{} + 1h;
  for (int i = 0; i < 400; ++i, now += 250ms)
    EXPECT_TRUE(control.update(0.1, 1, std::span(&session, 1), now).empty());
  EXPECT_EQ(EffortControl(2, {.threads = 4}).initial(9, {640, 360}).threads, 4);
}

TEST_F(EffortControlTest, ManyWhoComeTogetherBeginWithWhatTheyUsuallyCost) {
  EXPECT_EQ(control.initial(1, full_hd).preset, superfast);
  EXPECT_EQ(control.initial(2, full_hd).preset, superfast);
  EXPECT_EQ(control.initial(3, full_hd).preset, superfast - 1);
  EXPECT_EQ(control.initial(12, full_hd).preset, ultrafast);
  EXPECT_EQ(control.initial(12, {640, 360}).preset, superfast);
}

TEST_F(EffortControlTest, ANewcomerBeginsWithWhatThereIsRoomFor) {
  EXPECT_EQ(control.initial(1, full_hd).preset, superfast);
  other_cpus = 2.0;
  add(6, 0.1);
  run(1s);  // 3.14 with these at superfast, and a seventh takes 0.19
  EXPECT_EQ(control.initial(7, full_hd).preset, superfast);
  other_cpus = 2.7;
  run(1s);
  EXPECT_EQ(control.initial(7, full_hd).preset, superfast - 1);
  EXPECT_EQ(control.initial(7, {640, 360}).preset, superfast);
  EXPECT_EQ(control.initial(9, full_hd).preset, ultrafast) << "two more are about to encode";
}

TEST(EffortControl, AFirstVisitorLeavesRoomOnASmallMachine) {
  EXPECT_EQ(EffortControl(2, {}).initial(1, full_hd).preset, ultrafast);
  EXPECT_EQ(EffortControl(2, {}).initial(1, {640, 360}).preset, superfast);
}

TEST_F(EffortControlTest, NoMoreThanHalfOfTheSessionsChangeAtOnce) {
  add(40, 0.5);
  run(1s);
  EXPECT_EQ(run(500ms), 20);
}

}  // namespace
}  // namespace catgs
