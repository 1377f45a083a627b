// What owners learn of visits, and that it tells no visitors apart.

#include "server/counts/visit_counts.h"

#include "server/counts/visit_tally.h"
#include "tests/server/counts/a_day.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

class VisitCountsTest : public testing::Test {
 protected:
  std::int64_t now_s_ = noon;
  VisitCounts counts_{[this] { return now_s_; }};
  TimePoint now_ = TimePoint{} + 1h;
};

TEST_F(VisitCountsTest, AVisitIsCountedWithItsTimeAndBytes) {
  VisitTally tally(&counts_);
  tally.on_show("hall", DeviceKind::phone, 0, now_);
  tally.on_show("hall", DeviceKind::phone, 1000, now_ += 250ms);
  tally.off_show();
  tally.on_show("hall", DeviceKind::phone, 1500, now_ += 10min);
  tally.on_show("hall", DeviceKind::phone, 2500, now_ += 250ms);
  const SceneCounts hall = counts_.day(today).at("hall");
  EXPECT_EQ(hall.visits, 1u);
  EXPECT_DOUBLE_EQ(hall.seconds, 0.5) << "the page was hidden meanwhile";
  EXPECT_EQ(hall.bytes, 2500u);
  EXPECT_EQ(hall.devices[static_cast<std::size_t>(DeviceKind::phone)], 1u);
}

TEST_F(VisitCountsTest, AnotherSceneIsAnotherVisit) {
  VisitTally tally(&counts_);
  tally.on_show("hall", DeviceKind::desktop, 0, now_);
  tally.on_show("garden", DeviceKind::desktop, 100, now_ += 1s);
  tally.on_show("garden", DeviceKind::desktop, 300, now_ += 1s);
  const DayCounts day = counts_.day(today);
  EXPECT_EQ(day.at("hall").visits, 1u);
  EXPECT_EQ(day.at("garden").visits, 1u);
  EXPECT_EQ(day.at("garden").bytes, 300u);
}

TEST_F(VisitCountsTest, AStopCountsOnceInAVisit) {
  VisitTally a(&counts_), b(&counts_);
  const auto reach = [](VisitTally& tally, const char* scene, StopId stop) {
    for (int i = 0; i < 3; ++i) tally.reached(scene, DeviceKind::desktop, stop);
  };
  reach(a, "hall", {0, 1});  // before its first tick
  reach(b, "hall", {0, 1});
  a.on_show("hall", DeviceKind::desktop, 0, now_);
  reach(a, "hall", {0, 2});
  reach(a, "garden", {0, 2});  // the next scene, before its first tick
  EXPECT_EQ(counts_.day(today).at("hall").visits, 2u);
  EXPECT_EQ(counts_.day(today).at("garden").stops.size(), 1u);
  const auto stops = counts_.day(today).at("hall").stops;
  EXPECT_EQ(stops, (std::map<StopId, std::uint64_t>{{{0, 1}, 2}, {{0, 2}, 1}}));
}

TEST_F(VisitCountsTest, NothingIsCountedUnlessConfigured) {
  VisitTally tally(nullptr);
  tally.on_show("hall", DeviceKind::desktop, 0, now_);
  tally.reached("hall", DeviceKind::desktop, {0, 0});
  EXPECT_TRUE(counts_.dates().empty());
}

TEST_F(VisitCountsTest, DaysAreThoseOfUtcAndOldOnesGo) {
  for (std::size_t i = 0; i < VisitCounts::most_days + 3; ++i) {
    counts_.visit("hall", DeviceKind::unknown);
    now_s_ += day_s;
  }
  EXPECT_EQ(counts_.dates().size(), VisitCounts::most_days);
  EXPECT_EQ(counts_.dates().front(), "2025-11-28");
  now_s_ = 0;  // a clock that is not set
  counts_.visit("hall", DeviceKind::unknown);
  EXPECT_EQ(counts_.dates().size(), VisitCounts::most_days);
  EXPECT_EQ(counts_.dates().front(), "1970-01-01");
  EXPECT_EQ(date_of(noon + day_s / 2 - 1), "2025-11-25");
  EXPECT_EQ(date_of(noon + day_s / 2), "2025-11-26");
}

TEST_F(VisitCountsTest, MoreScenesThanItTellsApartAreCountedTogether) {
  for (std::size_t i = 0; i < VisitCounts::most_scenes + 5; ++i)
    counts_.visit("scene " + std::to_string(i), DeviceKind::unknown);
  const DayCounts day = counts_.day(today);
  EXPECT_EQ(day.size(), VisitCounts::most_scenes + 1);
  EXPECT_EQ(day.at(std::string(VisitCounts::other_scenes)).visits, 5u);
}

TEST_F(VisitCountsTest, CountsInMemoryHaveABound) {
  const auto fill_day = [&] {
    for (std::uint32_t i = 0; i < VisitCounts::most_stops; ++i)
      counts_.reach("hall", {i / 256, i % 256});
  };
  constexpr std::size_t full_days = VisitCounts::most_entries / VisitCounts::most_stops;
  for (std::size_t i = 0; i < full_days + 5; ++i) {
    fill_day();
    now_s_ += day_s;
  }
  std::size_t entries = 0;
  for (const std::string& date : counts_.dates()) {
    const DayCounts day = counts_.day(date);
    entries += day.size() + day.at("hall").stops.size();
  }
  EXPECT_LE(entries, VisitCounts::most_entries + VisitCounts::most_stops);
  EXPECT_EQ(counts_.dates().back(), date_of(now_s_ - day_s)) << "the oldest days go";
  // Days that are handed over make room again.
  for (const std::string& date : counts_.dates()) counts_.take(date);
  for (std::size_t i = 0; i < 3; ++i) {
    fill_day();
    now_s_ += day_s;
  }
  EXPECT_EQ(counts_.dates().size(), 3u);
}

TEST_F(VisitCountsTest, PartsOfADayAddUpWithinItsLimits) {
  DayCounts day;
  for (std::size_t i = 0; i < VisitCounts::most_scenes + 5; ++i)
    add({{"scene " + std::to_string(i), {.visits = 2, .seconds = 1.5}}}, day);
  add({{"scene 0", {.visits = 1, .bytes = 7, .stops = {{{0, 1}, 3}}}}}, day);
  add({{"scene 0", {.stops = {{{0, 1}, 4}, {{0, 2}, 1}}}}}, day);
  EXPECT_EQ(day.size(), VisitCounts::most_scenes + 1);
  EXPECT_EQ(day.at(std::string(VisitCounts::other_scenes)).visits, 10u);
  EXPECT_EQ(day.at("scene 0").visits, 3u);
  EXPECT_EQ(day.at("scene 0").bytes, 7u);
  EXPECT_EQ(day.at("scene 0").stops, (std::map<StopId, std::uint64_t>{{{0, 1}, 7}, {{0, 2}, 1}}));
}

}  // namespace
}  // namespace catgs::test
