// What owners learn of visits, and that it tells no visitors apart.

#include "server/counts/visit_counts.h"

#include <filesystem>
#include <fstream>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "server/counts/visit_book.h"
#include "server/counts/visit_tally.h"
#include "server/counts/visits_page.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::int64_t noon = 1'764'072'000;  // 2025-11-25 12:00:00 UTC
constexpr std::int64_t day_s = 86'400;

class VisitCountsTest : public testing::Test {
 protected:
  std::string page(const std::string& path, std::vector<std::string> arguments = {}) {
    const VisitsPage pages(
        counts_, [this] { return now_s_; }, [this](const auto&) { return titles_; });
    HttpRequest request;
    request.path = path;
    request.arguments = std::move(arguments);
    const auto answer = pages.respond(request);
    return answer && answer->status == 200 ? *answer->body : std::string();
  }

  std::int64_t now_s_ = noon;
  VisitCounts counts_{[this] { return now_s_; }};
  std::vector<TourTitles> titles_;
  TimePoint now_ = TimePoint{} + 1h;
};

TEST_F(VisitCountsTest, AVisitIsCountedWithItsTimeAndBytes) {
  VisitTally tally(&counts_);
  tally.on_show("hall", DeviceKind::phone, 0, now_);
  tally.on_show("hall", DeviceKind::phone, 1000, now_ += 250ms);
  tally.off_show();
  tally.on_show("hall", DeviceKind::phone, 1500, now_ += 10min);
  tally.on_show("hall", DeviceKind::phone, 2500, now_ += 250ms);
  const auto all = counts_.since();
  const SceneCounts& hall = all.at("2025-11-25").at("hall");
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
  const DayCounts day = counts_.since().at("2025-11-25");
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
  EXPECT_EQ(counts_.since().at("2025-11-25").at("hall").visits, 2u);
  EXPECT_EQ(counts_.since().at("2025-11-25").at("garden").stops.size(), 1u);
  const auto stops = counts_.since().at("2025-11-25").at("hall").stops;
  EXPECT_EQ(stops, (std::map<StopId, std::uint64_t>{{{0, 1}, 2}, {{0, 2}, 1}}));
}

TEST_F(VisitCountsTest, WithoutTheSettingNothingIsCounted) {
  VisitTally tally(nullptr);
  tally.on_show("hall", DeviceKind::desktop, 0, now_);
  tally.reached("hall", DeviceKind::desktop, {0, 0});
  EXPECT_TRUE(counts_.since().empty());
}

TEST_F(VisitCountsTest, DaysAreThoseOfUtcAndOldOnesGo) {
  for (std::size_t i = 0; i < VisitCounts::most_days + 3; ++i) {
    counts_.visit("hall", DeviceKind::unknown);
    now_s_ += day_s;
  }
  const auto all = counts_.since();
  EXPECT_EQ(all.size(), VisitCounts::most_days);
  EXPECT_EQ(all.begin()->first, "2025-11-28");
  now_s_ = 0;  // a clock that is not set
  counts_.visit("hall", DeviceKind::unknown);
  EXPECT_EQ(counts_.since().size(), VisitCounts::most_days);
  EXPECT_EQ(counts_.since().begin()->first, "1970-01-01");
  EXPECT_EQ(date_of(noon + day_s / 2 - 1), "2025-11-25");
  EXPECT_EQ(date_of(noon + day_s / 2), "2025-11-26");
}

TEST_F(VisitCountsTest, MoreScenesThanItTellsApartAreCountedTogether) {
  for (std::size_t i = 0; i < VisitCounts::most_scenes + 5; ++i)
    counts_.visit("scene " + std::to_string(i), DeviceKind::unknown);
  const DayCounts day = counts_.since().at("2025-11-25");
  EXPECT_EQ(day.size(), VisitCounts::most_scenes + 1);
  EXPECT_EQ(day.at(std::string(VisitCounts::other_scenes)).visits, 5u);
}

class VisitBookTest : public VisitCountsTest {
 protected:
  [[nodiscard]] static std::size_t files_in(const fs::path& folder) {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }

  const TemporaryFolder folder_;
};

TEST_F(VisitBookTest, KeepsCountsFromOneStartToTheNext) {
  const fs::path folder = folder_ / "visits";
  {
    const VisitBook book(folder, counts_);
    counts_.visit("hall \"A\"", DeviceKind::tablet);
    counts_.spend("hall \"A\"", 12.5, 1'000'000'000'000);
    counts_.reach("hall \"A\"", {1, 2});
    now_s_ += day_s;
    counts_.visit("garden", DeviceKind::headset);
  }
  VisitCounts next([this] { return now_s_; });
  const VisitBook book(folder, next);
  const auto all = next.since();
  ASSERT_EQ(all.size(), 2u);
  const SceneCounts& hall = all.at("2025-11-25").at("hall \"A\"");
  EXPECT_EQ(hall.visits, 1u);
  EXPECT_EQ(hall.seconds, 12.5);
  EXPECT_EQ(hall.bytes, 1'000'000'000'000u);
  EXPECT_EQ(hall.devices[static_cast<std::size_t>(DeviceKind::tablet)], 1u);
  EXPECT_EQ(hall.stops, (std::map<StopId, std::uint64_t>{{{1, 2}, 1}}));
  EXPECT_EQ(files_in(folder), 2u);
}

TEST_F(VisitBookTest, ADayWithinAllLimitsIsReadAgain) {
  for (std::size_t i = 0; i < VisitCounts::most_scenes + 5; ++i)
    counts_.visit(std::string(120, 'x') + std::to_string(i), DeviceKind::unknown);
  const std::string first = counts_.since().begin()->second.begin()->first;
  for (std::uint32_t i = 0; i < VisitCounts::most_stops + 5; ++i)
    counts_.reach(first, {i / 256, i % 256});
  {
    const VisitBook book(folder_.path(), counts_);
    counts_.visit("one more", DeviceKind::unknown);
  }
  VisitCounts next([this] { return now_s_; });
  const VisitBook book(folder_.path(), next);
  const DayCounts day = next.since().at("2025-11-25");
  EXPECT_EQ(day.size(), VisitCounts::most_scenes + 1);
  EXPECT_EQ(day.at(first).stops.size(), VisitCounts::most_stops);
}

TEST_F(VisitBookTest, SetsADamagedDayAsideAndKeepsTheOthers) {
  const fs::path folder = folder_.path();
  {
    const VisitBook book(folder, counts_);
    counts_.visit("hall", DeviceKind::unknown);
  }
  std::ofstream(folder / "visits-2025-11-24.json") << R"({"scenes":{"hall":{"visits":-1}}})";
  std::ofstream(folder / "visits-notes.json") << "of somebody else";
  VisitCounts next([this] { return now_s_; });
  { const VisitBook book(folder, next); }
  EXPECT_EQ(next.since().size(), 1u);
  EXPECT_TRUE(fs::exists(folder / "visits-2025-11-24.json.damaged"));
  EXPECT_TRUE(fs::exists(folder / "visits-notes.json"));
}

TEST_F(VisitBookTest, AFolderThatCannotBeUsedIsNamed) {
  std::ofstream(folder_ / "file") << "";
  try {
    const VisitBook book(folder_ / "file", counts_);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("file"));
  }
}

TEST_F(VisitCountsTest, ThePageShowsWhatWasCountedAndEscapesIt) {
  counts_.visit("<hall>", DeviceKind::desktop);
  counts_.spend("<hall>", 7200.0, 3'000'000'000);
  counts_.reach("<hall>", {0, 0});
  counts_.reach("<hall>", {0, 7});
  titles_ = {{"The <house>", {"Gate & door"}}};
  const std::string all = page("/visits");
  EXPECT_THAT(all, AllOf(HasSubstr("1 visits, 2.0 hours"), HasSubstr("<td>1500</td>"),
                         HasSubstr("scene=%3Chall%3E"), Not(HasSubstr("<hall>"))));
  const std::string one = page("/visits", {"scene=<hall>", "days=7"});
  EXPECT_THAT(one, AllOf(HasSubstr("The &lt;house&gt;"), HasSubstr("Gate &amp; door"),
                         HasSubstr("stop 8"), Not(HasSubstr("<house>"))));
  EXPECT_THAT(page("/visits", {"days=-5"}), HasSubstr("1 days"));
  EXPECT_EQ(page("/visit"), "");
}

TEST_F(VisitCountsTest, CsvIsForSpreadsheetsAndHoldsNoFormula) {
  counts_.visit("=1+\"1\"", DeviceKind::desktop);
  counts_.reach("=1+\"1\"", {0, 0});
  EXPECT_EQ(page("/visits.csv"),
            "date,scene,visits,seconds,bytes,unknown,desktop,phone,tablet,headset\r\n"
            "2025-11-25,\"'=1+\"\"1\"\"\",1,0,0,0,1,0,0,0\r\n");
  EXPECT_THAT(page("/visits/stops.csv"),
              HasSubstr("2025-11-25,\"'=1+\"\"1\"\"\",1,1,\"tour 1\",\"stop 1\",1\r\n"));
}

TEST(TitlesOfTours, AreThoseOfTheSidecarOrNone) {
  const auto titles =
      titles_of_tours(R"({"may_save":false,"document":{"tours":[{"title":"Empty","stops":[]},)"
                      R"({"title":"House","stops":[{"title":"Gate"},{"caption":"no title"}]}]}})");
  ASSERT_EQ(titles.size(), 1u) << "pages leave out tours without stops";
  EXPECT_EQ(titles[0].tour, "House");
  EXPECT_EQ(titles[0].stops, (std::vector<std::string>{"Gate", ""}));
  for (const char* other : {"", "{}", R"({"document":{"tours":null}})",
                            R"({"document":{"tours":[{"stops":5}]}})", "[1"})
    EXPECT_TRUE(titles_of_tours(other).empty()) << other;
}

}  // namespace
}  // namespace catgs::test
