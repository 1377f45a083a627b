// Counts of visits over days and starts, and the pages that show them.

#include "server/counts/usage_statistics.h"

#include <nlohmann/json.hpp>
#include <sys/stat.h>

#include "server/counts/visit_tally.h"
#include "server/counts/visits_page.h"
#include "tests/server/counts/a_day.h"
#include "tests/support/descriptor_limit.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

namespace fs = std::filesystem;

class UsageStatisticsTest : public testing::Test {
 protected:
  [[nodiscard]] std::size_t files() const {
    const auto is_day = [](const fs::directory_entry& entry) {
      return entry.path().extension() == ".json";
    };
    return static_cast<std::size_t>(
        std::count_if(fs::directory_iterator(folder_.path()), fs::directory_iterator(), is_day));
  }
  [[nodiscard]] fs::path file_of(const std::string& date) const {
    return folder_ / ("visits-" + date + ".json");
  }
  VisitsPage page_of(const UsageStatistics& statistics) {
    return {statistics, [this] { return now_s_.load(); }, [this](const auto&) { return titles_; }};
  }
  static HttpResponse charts(const VisitsPage& page, std::vector<std::string> arguments) {
    HttpRequest request;
    request.arguments = std::move(arguments);
    return page.charts(request);
  }
  static std::string rest_of(const HttpResponse& response) {
    std::string text;
    while (const auto piece = response.next_piece()) text += *piece;
    return text;
  }

  const TemporaryFolder folder_;
  Background background_;
  std::atomic<std::int64_t> now_s_{noon};
  VisitCounts counts_{[this] { return now_s_.load(); }};
  VisitsPage::Titles titles_;
};

TEST_F(UsageStatisticsTest, CountsStayFromOneStartToTheNext) {
  {
    const UsageStatistics statistics(folder_.path(), counts_, background_);
    counts_.visit("hall \"A\"", DeviceKind::tablet, "aa");
    counts_.spend("hall \"A\"", 12.5, 1'000'000'000'000);
    counts_.reach("hall \"A\"", {1, 2});
    now_s_ += day_s;
    counts_.visit("garden", DeviceKind::headset);
  }
  EXPECT_TRUE(counts_.dates().empty()) << "what is in a file is in memory no more";
  const UsageStatistics statistics(folder_.path(), counts_, background_);
  EXPECT_THAT(statistics.dates(), ElementsAre(today, "2025-11-26"));
  const SceneCounts hall = statistics.day(today).at("hall \"A\"");
  EXPECT_EQ(hall.visits, 1u);
  EXPECT_EQ(hall.seconds, 12.5);
  EXPECT_EQ(hall.bytes, 1'000'000'000'000u);
  EXPECT_EQ(hall.devices[static_cast<std::size_t>(DeviceKind::tablet)], 1u);
  EXPECT_EQ(hall.stops, (std::map<StopId, std::uint64_t>{{{1, 2}, 1}}));
  EXPECT_EQ(hall.links, (std::map<std::string, std::uint64_t>{{"aa", 1}}));
  EXPECT_EQ(files(), 2u);
  counts_.visit("garden", DeviceKind::headset);
  EXPECT_EQ(statistics.day("2025-11-26").at("garden").visits, 2u)
      << "in the file, and not yet there";
}

TEST_F(UsageStatisticsTest, CountsStayInMemoryWhenThereIsNoFolder) {
  const UsageStatistics statistics({}, counts_, background_);
  counts_.visit("hall", DeviceKind::tablet);
  EXPECT_THAT(statistics.dates(), ElementsAre(today));
  EXPECT_EQ(statistics.day(today).at("hall").visits, 1u);
}

TEST_F(UsageStatisticsTest, ADayWithinAllLimitsIsReadAgain) {
  const std::string first = std::string(120, 'x') + "0";
  for (std::size_t i = 0; i < VisitCounts::most_scenes + 5; ++i)
    counts_.visit(std::string(120, 'x') + std::to_string(i), DeviceKind::unknown);
  for (std::uint32_t i = 0; i < VisitCounts::most_stops + 5; ++i)
    counts_.reach(first, {i / 256, i % 256});
  { const UsageStatistics statistics(folder_.path(), counts_, background_); }
  counts_.visit("one more", DeviceKind::unknown);
  counts_.reach(first, {1'000, 0});
  { const UsageStatistics statistics(folder_.path(), counts_, background_); }
  const DayCounts day = UsageStatistics(folder_.path(), counts_, background_).day(today);
  EXPECT_EQ(day.size(), VisitCounts::most_scenes + 1);
  EXPECT_EQ(day.at(std::string(VisitCounts::other_scenes)).visits, 6u);
  EXPECT_EQ(day.at(first).stops.size(), VisitCounts::most_stops);
}

TEST_F(UsageStatisticsTest, TheStartReadsNoDay) {
  std::ofstream(file_of("2025-11-24")) << R"({"scenes":{"hall":{"visits":-1}}})";
  ASSERT_EQ(::mkfifo(file_of("2025-11-23").c_str(), 0600), 0);
  std::ofstream(folder_ / "visits-notes.json") << "of somebody else";
  const UsageStatistics statistics(folder_.path(), counts_, background_);
  EXPECT_TRUE(fs::exists(file_of("2025-11-24")));
  EXPECT_THAT(statistics.dates(), ElementsAre("2025-11-23", "2025-11-24"));
  for (const std::string& date : statistics.dates()) {
    EXPECT_TRUE(statistics.day(date).empty());
    EXPECT_FALSE(fs::exists(file_of(date)));
    EXPECT_TRUE(fs::exists(file_of(date).string() + ".damaged")) << "it is set aside";
  }
  EXPECT_TRUE(fs::exists(folder_ / "visits-notes.json"));
}

TEST_F(UsageStatisticsTest, OldDaysAreDeleted) {
  for (std::size_t i = 0; i < VisitCounts::most_days + 3; ++i)
    std::ofstream(file_of(date_of(noon - static_cast<std::int64_t>(i) * day_s))) << "{}";
  {
    const UsageStatistics statistics(folder_.path(), counts_, background_);
    EXPECT_EQ(statistics.dates().size(), VisitCounts::most_days);
    now_s_ += day_s;
    counts_.visit("hall", DeviceKind::unknown);
  }
  EXPECT_EQ(files(), VisitCounts::most_days) << "a new day takes the place of the oldest";
  EXPECT_TRUE(fs::exists(file_of("2025-11-26")));
}

TEST_F(UsageStatisticsTest, AFolderServesOneServerAtATime) {
  const auto refused = [&](const fs::path& folder) -> std::string {
    try {
      VisitCounts counts([] { return noon; });
      const UsageStatistics statistics(folder, counts, background_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  {
    const UsageStatistics statistics(folder_.path(), counts_, background_);
    EXPECT_THAT(refused(folder_.path()),
                AllOf(HasSubstr("--visit-counts"), HasSubstr("another server")));
  }
  fs::remove(folder_ / "visits.lock");
  fs::create_directory(folder_ / "visits.lock");
  EXPECT_THAT(refused(folder_.path()),
              HasSubstr("its file visits.lock cannot be locked: Is a directory (remove that file"));
  fs::remove(folder_ / "visits.lock");
  EXPECT_EQ(refused(folder_.path()), "");
  std::ofstream(folder_ / "file") << "";
  EXPECT_THAT(refused(folder_ / "file"), AllOf(HasSubstr("--visit-counts"), HasSubstr("file")));
}

TEST_F(UsageStatisticsTest, ADayThatCannotBeWrittenWaits) {
  fs::create_directories(file_of(today).string() + ".damaged/inside");
  fs::create_directories(file_of(today) / "inside");
  {
    const UsageStatistics statistics(folder_.path(), counts_, background_);
    counts_.visit("hall", DeviceKind::unknown);
  }
  EXPECT_EQ(counts_.day(today).at("hall").visits, 1u);
  fs::remove_all(file_of(today));
  { const UsageStatistics statistics(folder_.path(), counts_, background_); }
  EXPECT_EQ(UsageStatistics(folder_.path(), counts_, background_).day(today).at("hall").visits, 1u);
}

TEST_F(UsageStatisticsTest, ADayThatCannotBeOpenedNowIsReadLater) {
  std::ofstream(file_of(today)) << counts_json({{"hall", {.visits = 1}}});
  const UsageStatistics statistics(folder_.path(), counts_, background_);
  {
    const DescriptorLimit none_is_left(next_descriptor());
    EXPECT_THROW((void)statistics.day(today), InputError);
  }
  EXPECT_EQ(statistics.day(today).at("hall").visits, 1u);
}

/// Several visits go on while the clock passes midnight and is set back, and days are written and
/// read all the time.
TEST_F(UsageStatisticsTest, NothingIsLostOrCountedTwiceAtMidnight) {
  constexpr int visitors = 3, enough = 500;
  constexpr std::int64_t midnight = noon + day_s / 2;
  std::array<std::atomic<int>, 2> surely{};  // visits that began and ended on one day
  std::atomic<std::uint64_t> all{0};
  std::atomic<bool> ended{false}, grows{true};
  {
    const UsageStatistics statistics(folder_.path(), counts_, background_, 1ms);
    const auto visit = [&](std::uint32_t visitor) {
      TimePoint now = TimePoint{} + 1h;
      for (std::uint32_t i = 0; !ended; ++i, ++all) {
        const bool before = now_s_ < midnight;
        VisitTally tally(&counts_);
        tally.on_show("hall", DeviceKind::desktop, 0, now);
        if (before == (now_s_ < midnight)) ++surely[before ? 0 : 1];
        tally.on_show("hall", DeviceKind::desktop, 10, now += 1s);
        tally.reached("hall", DeviceKind::desktop, {visitor, i % 200});
      }
    };
    std::vector<std::thread> threads;
    for (std::uint32_t i = 0; i < visitors; ++i) threads.emplace_back(visit, i);
    threads.emplace_back([&] {
      for (std::uint64_t seen = 0; !ended;) {
        const DayCounts day = statistics.day("2025-11-26");
        const std::uint64_t now = day.empty() ? 0 : day.at("hall").visits;
        if (now < seen) grows = false;
        seen = now;
      }
    });
    for (std::int64_t i = 0; surely[0] < enough || surely[1] < enough; ++i)
      now_s_ = midnight - 5 + i % 10;
    ended = true;
    for (std::thread& thread : threads) thread.join();
  }
  EXPECT_TRUE(grows) << "a day lost visits for a while";
  const UsageStatistics statistics(folder_.path(), counts_, background_);
  ASSERT_THAT(statistics.dates(), ElementsAre(today, "2025-11-26"));
  const SceneCounts before = statistics.day(today).at("hall"),
                    after = statistics.day("2025-11-26").at("hall");
  EXPECT_EQ(before.visits + after.visits, all);
  EXPECT_GE(before.visits, static_cast<std::uint64_t>(surely[0]));
  EXPECT_GE(after.visits, static_cast<std::uint64_t>(surely[1]));
  EXPECT_DOUBLE_EQ(before.seconds + after.seconds, static_cast<double>(all));
  EXPECT_EQ(before.bytes + after.bytes, 10 * all);
  std::uint64_t stops = 0;
  for (const SceneCounts* day : {&before, &after})
    for (const auto& [stop, visits] : day->stops) stops += visits;
  EXPECT_EQ(stops, all);
}

TEST_F(UsageStatisticsTest, TheSummaryHasCountsAndTitles) {
  const UsageStatistics statistics({}, counts_, background_);
  const VisitsPage pages = page_of(statistics);
  counts_.visit("<hall>", DeviceKind::desktop, "3f0c91d27a5e");
  counts_.spend("<hall>", 4212.0, 3'000'000'000);
  counts_.reach("<hall>", {0, 0});
  counts_.reach("<hall>", {0, 7});
  titles_.tours = std::make_shared<const std::vector<TourTitles>>(
      std::vector<TourTitles>{{"The <house>", {"Gate & door"}}});
  const auto summary = [&](std::vector<std::string> arguments) {
    return nlohmann::json::parse(rest_of(charts(pages, std::move(arguments))));
  };
  const auto rows_of = [](const nlohmann::json& part) { return part.at("table").at("rows"); };
  const auto all = summary({});
  EXPECT_EQ(all.at("facts"), "1 visits, 1.2 hours");
  const auto& days = all.at("parts").at(0).at("plots").at(1).at("curves").at(0);
  EXPECT_EQ(days.at("x").back(), today);
  EXPECT_EQ(days.at("y").back(), 1.17);
  EXPECT_EQ(days.at("x").size(), 30u);
  EXPECT_EQ(rows_of(all.at("parts").at(1)).dump(),
            R"([[{"href":"visits?days=30&scene=%3Chall%3E","text":"<hall>"},)"
            R"(1,"1:10",70.2,2564.1,1,0,0,0,0]])");
  const auto one = summary({"scene=<hall>", "days=7"});
  EXPECT_EQ(one.at("title"), "Visits: <hall>, 7 days");
  EXPECT_EQ(rows_of(one.at("parts").at(2)).dump(),
            R"([["3f0c91d27a5e",1],["none, or not counted by link",0]])");
  EXPECT_EQ(rows_of(one.at("parts").at(3)).dump(),
            R"([["The <house>","Gate & door",1],["The <house>","stop 8",1]])");
  EXPECT_EQ(summary({"days=-5"}).at("title"), "Visits: all scenes, 1 days");
}

TEST_F(UsageStatisticsTest, OwnersSeeTheirScenesByTitleAndNoOthers) {
  const UsageStatistics statistics({}, counts_, background_);
  const VisitsPage pages = page_of(statistics);
  titles_.scene = "The hall";
  counts_.visit("hall-kdfmqrtv", DeviceKind::phone, "aa");
  counts_.visit("hall-kdfmqrtv", DeviceKind::phone);
  counts_.visit("cellar", DeviceKind::phone, "bb");
  for (const auto& arguments :
       {std::vector<std::string>{}, {"scene=hall-kdfmqrtv"}, {"scene=cellar"}}) {
    HttpRequest request;
    request.arguments = arguments;
    const std::string page =
        rest_of(pages.charts(request, [](const std::string& id) { return id == "hall-kdfmqrtv"; }));
    EXPECT_THAT(
        page,
        AllOf(HasSubstr(R"("The hall","href":"visits?days=30&scene=hall-kdfmqrtv"},2,)"),
              HasSubstr("2 visits"), HasSubstr(R"([["aa",1],["none, or not counted by link",1]])"),
              Not(HasSubstr("cellar")), Not(HasSubstr("bb")), Not(HasSubstr("csv"))));
  }
}

TEST_F(UsageStatisticsTest, CsvIsForSpreadsheetsAndHoldsNoFormula) {
  const UsageStatistics statistics({}, counts_, background_);
  const VisitsPage pages = page_of(statistics);
  counts_.visit("=1+\"1\"", DeviceKind::desktop);
  counts_.reach("=1+\"1\"", {0, 0});
  EXPECT_EQ(rest_of(pages.visits_csv()),
            "date,scene,visits,seconds,bytes,unknown,desktop,phone,tablet,headset\r\n"
            "2025-11-25,\"'=1+\"\"1\"\"\",1,0,0,0,1,0,0,0\r\n");
  EXPECT_THAT(rest_of(pages.stops_csv()),
              HasSubstr("2025-11-25,\"'=1+\"\"1\"\"\",1,1,\"tour 1\",\"stop 1\",1\r\n"));
}

/// The network thread asks for an answer. Another one makes its pieces.
TEST_F(UsageStatisticsTest, PagesReadOneDayForEachPiece) {
  const auto write = [&](const char* date, const char* scene) {
    std::ofstream(file_of(date)) << counts_json({{scene, {.visits = 1, .stops = {{{0, 0}, 1}}}}});
  };
  const UsageStatistics statistics(folder_.path(), counts_, background_);
  const VisitsPage pages = page_of(statistics);
  const std::map<std::string, std::function<HttpResponse()>> documents = {
      {"charts", [&] { return charts(pages, {"days=4"}); }},
      {"visits", [&] { return pages.visits_csv(); }},
      {"stops", [&] { return pages.stops_csv(); }}};
  for (const auto& [name, document] : documents) {
    for (const char* date : {"2025-11-22", "2025-11-23", "2025-11-24"}) write(date, "before");
    const HttpResponse response = document();
    ASSERT_EQ(response.body, nullptr);
    write("2025-11-22", "changed_1");
    std::string text = response.next_piece().value();
    if (name != "charts") text += response.next_piece().value();  // after its head
    write("2025-11-23", "changed_2");
    text += response.next_piece().value();
    write("2025-11-24", "changed_3");
    text += rest_of(response);
    EXPECT_THAT(text, AllOf(HasSubstr("changed_1"), HasSubstr("changed_2"), HasSubstr("changed_3"),
                            Not(HasSubstr("before"))))
        << name;
  }
}

TEST_F(UsageStatisticsTest, PiecesOfALongPageHaveALargestSize) {
  const UsageStatistics statistics({}, counts_, background_);
  for (std::uint32_t i = 0; i < VisitCounts::most_stops; ++i)
    counts_.reach("hall", {i / 256, i % 256});
  const VisitsPage pages = page_of(statistics);
  const HttpResponse response = pages.stops_csv();
  std::size_t bytes = 0, pieces = 0;
  while (const auto piece = response.next_piece()) {
    EXPECT_LE(piece->size(), 64u * 1024u);
    bytes += piece->size();
    ++pieces;
  }
  EXPECT_GT(bytes, 20u * VisitCounts::most_stops);
  EXPECT_GT(pieces, 5u);
}

}  // namespace
}  // namespace catgs::test
