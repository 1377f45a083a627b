#include "tests/load/scenario.h"

#include <csignal>

#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "tests/load/chart_document.h"
#include "tests/load/picture_check.h"
#include "tests/load/server_metrics.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::load {
namespace {

class ScenarioFile : public ::testing::Test {
 protected:
  Scenario read(const std::string& text) {
    std::ofstream(folder_ / "s.toml") << text;
    return read_scenario(folder_ / "s.toml");
  }
  void expect_refused(const std::string& text, const std::string& message) {
    EXPECT_THAT([&] { read(text); }, ThrowsMessage<InputError>(HasSubstr(message)));
  }
  const test::TemporaryFolder folder_;
};

TEST_F(ScenarioFile, SaysEverythingAboutARun) {
  const Scenario scenario = read(R"(
title = "t"
duration = "20s"
require = ["a.errors==0"]
check-scene = "synth:city:100"
[held]
pose-age-p95-ms = 60
[server]
args = ["--scene", "x"]
[[server.signals]]
at = "5s"
signal = "STOP"
[[clients]]
name = "a"
sessions = 3
traces = ["t.tum"]
sizes = ["160x90", "320x180"]
link = "rate=1mbit"
[[clients]]
name = "b"
script = "head"
acks = false
stall-at = "1s"
stall-for = "2s"
)");
  EXPECT_EQ(scenario.title, "t");
  EXPECT_EQ(scenario.load.duration_s, 20.0);
  EXPECT_EQ(scenario.bounds.pose_age_p95_ms, 60.0);
  EXPECT_EQ(scenario.bounds.pose_to_frame_p95_ms, 33.0);
  ASSERT_EQ(scenario.signals.size(), 1u);
  EXPECT_EQ(scenario.signals[0].number, SIGSTOP);
  EXPECT_EQ(scenario.signals[0].at_s, 5.0);
  ASSERT_EQ(scenario.load.groups.size(), 2u);
  const GroupOptions& a = scenario.load.groups[0];
  EXPECT_EQ(a.sessions, 3);
  EXPECT_EQ(a.traces, std::vector<std::string>{(folder_ / "t.tum").string()});
  EXPECT_EQ(a.sizes.size(), 2u);
  EXPECT_EQ(a.link.down.at(0).bits_per_s, 1e6);
  const GroupOptions& b = scenario.load.groups[1];
  EXPECT_FALSE(b.manners.acknowledge);
  EXPECT_EQ(b.manners.stall_for_s, 2.0);
}

TEST_F(ScenarioFile, NamesTheLineOfAMistake) {
  expect_refused("", "has no [[clients]]");
  expect_refused("duration = \"soon\"\n[[clients]]\n", "line 1: --duration");
  expect_refused("[[clients]]\nsession = 3\n",
                 "line 2: nothing is called \"session\" here (did you mean sessions?)");
  expect_refused("[held]\nlag = 3\n", "(one of pose-to-frame-p95-ms, pose-age-p95-ms, psnr-db)");
  expect_refused("[[clients]]\nsessions = \"many\"\n", "line 2");
  expect_refused("[[clients]]\nsessions = 0\n", "line 2: --sessions");
  expect_refused("[[clients]]\nlink = \"speed=1mbit\"\n", "line 2: --link");
  expect_refused("[[clients]]\nsizes = [[1]]\n", "line 2");
  expect_refused("clients = 3\n", "line 1: clients is not a table");
  expect_refused("[[clients]]\n[[server.signals]]\nsignal = \"BOOM\"\n", "BOOM");
  expect_refused("[[clients]\n", "line 1");
}

TEST_F(ScenarioFile, AMatrixHasARowForEachCombination) {
  const std::string text = R"(
check-scene = ["synth:city:100", "synth:garden:100"]
[matrix]
row = "5s"
[[matrix.trace]]
name = "head"
script = "head"
[[matrix.trace]]
name = "recorded"
trace = "t.tum"
sizes = ["320x180"]
[[matrix.link]]
name = "clean"
[[matrix.link]]
name = "step"
link = "rate=5mbit,1mbit@2s"
[[clients]]
glass = true
sizes = ["160x90"]
)";
  const Scenario scenario = read(text);
  EXPECT_EQ(scenario.load.duration_s, 40.0);
  EXPECT_THAT(scenario.server_args,
              ElementsAre("--scene", "synth:city:100", "--scene", "synth:garden:100"));
  ASSERT_EQ(scenario.load.groups.size(), 8u);
  const GroupOptions& row = scenario.load.groups[3];
  EXPECT_EQ(row.name, "city/recorded/step");
  EXPECT_EQ(row.wishes.scene, "city");
  EXPECT_TRUE(row.display.judged);
  EXPECT_EQ(row.traces, std::vector<std::string>{(folder_ / "t.tum").string()});
  EXPECT_EQ(row.sizes, std::vector<std::string>{"320x180"});
  EXPECT_EQ(row.start_s, 15.0);
  EXPECT_EQ(row.end_s, 20.0);
  ASSERT_EQ(row.link.down.size(), 2u);
  EXPECT_EQ(row.link.down[0].from_us, 0) << "rates count from the row's begin";
  EXPECT_EQ(row.link.down[1].from_us, 17'000'000);
  EXPECT_EQ(scenario.load.groups[4].name, "garden/head/clean");
  const std::vector<std::string> other = {"synth:stress:100"};
  EXPECT_EQ(read_scenario(folder_ / "s.toml", other).load.groups.size(), 4u);

  expect_refused("[matrix]\n[[clients]]\n", "a matrix needs check-scene");
  expect_refused("[matrix]\n[[clients]]\n[[clients]]\n", "line 3: a matrix has one [[clients]]");
  expect_refused("check-scene = \"synth:city:1\"\n[[matrix.trace]]\nname = \"a\"\n[[clients]]\n",
                 "a matrix needs a [[matrix.link]]");
  expect_refused("check-scene = \"synth:city:1\"\n[[matrix.trace]]\n[[clients]]\n",
                 "line 2: a trace of a matrix needs a name");
  expect_refused(
      "check-scene = [\"synth:city:1\", \"synth:city:2\"]\n[matrix]\n[[matrix.trace]]\n"
      "name = \"a\"\n[[matrix.link]]\nname = \"b\"\n[[clients]]\n",
      "line 2: check-scene: two are called \"city\"");
  expect_refused(
      "check-scene = \"synth:city:1\"\n[[matrix.trace]]\nname = \"a\"\n[[matrix.trace]]\n"
      "name = \"a\"\n[[clients]]\n",
      "line 4: matrix.trace: two are called \"a\"");
}

TEST_F(ScenarioFile, OverscanIsTwoFactors) {
  const auto overscan = [&](const std::string& value) {
    return read("[[clients]]\nglass = true\noverscan = \"" + value + "\"\n")
        .load.groups[0]
        .display.overscan;
  };
  EXPECT_EQ(overscan("1.26x1.12"), glm::dvec2(1.26, 1.12));
  for (const char* bad : {"1.26", "x", "0.9x1", "1x3", "1x1x1", "nanx1", ""})
    EXPECT_THROW(overscan(bad), InputError) << bad;
}

TEST(ServerMetrics, ChangesBetweenTwoAnswersAreMeasured) {
  const auto answer = [](int fast, int all, double sum_s, int frames, int sessions) {
    return nlohmann::ordered_json{
        {"catgs_stage_seconds",
         {{{"labels", {{"stage", "wait"}}},
           {"buckets", {{0.001, fast}, {0.01, all}, {nullptr, all}}},
           {"sum", sum_s}}}},
        {"catgs_frames_total", {{{"labels", nullptr}, {"value", frames}}}},
        {"catgs_sessions", {{{"labels", nullptr}, {"value", sessions}}}},
        {"catgs_scene_pages", {{{"labels", {{"scene", "city"}, {"device", "1"}}}, {"value", 7}}}}};
  };
  const auto before = answer(100, 100, 1.0, 7, 3), after = answer(150, 200, 1.5, 17, 4);
  const Metrics change = change_between(before, after, "server.");
  EXPECT_DOUBLE_EQ(value_of(change, "server.stage_wait_p50_ms"), 1.0);
  EXPECT_DOUBLE_EQ(value_of(change, "server.stage_wait_p95_ms"), 1.0 + 9.0 * 45.0 / 50.0);
  EXPECT_DOUBLE_EQ(value_of(change, "server.stage_wait_mean_ms"), 5.0);
  EXPECT_DOUBLE_EQ(value_of(change, "server.frames_total"), 10.0);
  EXPECT_DOUBLE_EQ(value_of(change, "server.sessions"), 4.0);
  EXPECT_DOUBLE_EQ(value_of(change, "server.scene_pages_city_1"), 7.0);
  EXPECT_TRUE(std::isnan(value_of(change_between(after, after, ""), "stage_wait_p50_ms")));
}

DecodedPicture grey(std::uint8_t luma, std::uint8_t cb, std::uint8_t cr, bool full_range) {
  DecodedPicture picture;
  picture.size_px = {2, 2};
  picture.planes = {std::vector<std::uint8_t>(4, luma), {cb}, {cr}};
  picture.full_range = full_range;
  return picture;
}

TEST(PictureCheck, ColoursOfBothRanges) {
  const auto expect_pixel = [](const DecodedPicture& picture, float r, float g, float b) {
    const std::vector<float> rgb = rgb_of(picture).rgb;
    ASSERT_EQ(rgb.size(), 12u);
    EXPECT_NEAR(rgb[9], r, 0.01f);
    EXPECT_NEAR(rgb[10], g, 0.01f);
    EXPECT_NEAR(rgb[11], b, 0.01f);
  };
  expect_pixel(grey(16, 128, 128, false), 0, 0, 0);
  expect_pixel(grey(235, 128, 128, false), 1, 1, 1);
  expect_pixel(grey(63, 102, 240, false), 1, 0, 0);  // BT.709 red
  expect_pixel(grey(255, 128, 128, true), 1, 1, 1);
  expect_pixel(grey(76, 85, 255, true), 1, 0, 0);  // JFIF red
}

TEST(ChartDocument, DisplaysOfOneMotionShareAPlot) {
  Outcome outcome;
  for (const char* name : {"city/head/clean", "city/head/step"}) {
    GroupReport& group = outcome.report.groups.emplace_back();
    group.name = name;
    group.series = std::make_unique<TimeSeries>(0);
    group.sessions.push_back(std::make_unique<SessionReport>(60.0, group.series.get()));
    SessionReport& session = *group.sessions[0];
    session.rests = 1;
    session.display.emplace();
    session.judged = {{.at_s = 0.5, .ssim = 0.9, .psnr_db = 30.0, .sampled = true},
                      {.at_s = 1.0, .ssim = 0.8, .psnr_db = 28.0, .rest = 1}};
  }
  const auto displays = chart_document({}, outcome).at("parts").at(0);
  const auto& row = displays.at("table").at("rows").at(1);
  EXPECT_EQ(row.at(0), "city/head/step");
  EXPECT_EQ(row.at(1), 0.9);
  EXPECT_EQ(row.at(12), "∞") << "it never became sharp";
  const auto& plots = displays.at("plots");
  ASSERT_EQ(plots.size(), 4u);
  EXPECT_EQ(plots.at(0).at("title"), "city/head: SSIM over time");
  const auto& curve = plots.at(0).at("curves").at(1);
  EXPECT_EQ(curve.at("name"), "step");
  EXPECT_EQ(curve.at("y"), nlohmann::json::array({0.9}));
}

TEST(ChartDocument, HasPlotsTablesAndAnEscapedPlaceInThePage) {
  Scenario scenario;
  scenario.title = "</script>";
  Outcome outcome;
  GroupReport& group = outcome.report.groups.emplace_back();
  group.name = "<i>";
  group.nominal_fps = 60.0;
  group.series = std::make_unique<TimeSeries>(0);
  group.sessions.push_back(std::make_unique<SessionReport>(60.0, group.series.get()));
  SessionStats& stats = group.sessions[0]->stats;
  stats.started(0);
  for (std::uint64_t i = 1; i <= 200; ++i) {
    const auto time_us = static_cast<std::int64_t>(i) * 16'000;
    stats.pose_sent(i, time_us);
    stats.frame_received({.frame_id = i, .pose_id = i, .bytes = 1000}, time_us + 9'000);
  }
  outcome.metrics = collect_metrics(outcome.report, {});
  outcome.requirements.emplace_back("errors<1");
  const auto document = chart_document(scenario, outcome);
  const auto& parts = document.at("parts");
  EXPECT_EQ(parts.at(0).at("table").at("rows").at(0).at(2), "does not hold")
      << "a figure that was not measured";
  EXPECT_EQ(parts.at(1).at("table").at("rows").at(0).at(0), "<i>");
  const auto& plots = parts.at(2).at("plots");
  EXPECT_EQ(plots.size(), 6u);
  const auto& curves = plots.at(0).at("curves");
  ASSERT_EQ(curves.size(), 2u) << "the group's and the bound";
  EXPECT_NEAR(curves.at(0).at("y").at(0).get<double>(), 9.0, 0.1);
  EXPECT_EQ(curves.at(1).at("y").at(0), 33.0);
  const auto& shares = parts.at(3).at("plots").at(1).at("curves").at(0);
  ASSERT_EQ(shares.at("x").size(), 1u);
  EXPECT_NEAR(shares.at("x").at(0).get<double>(), 16.0, 0.2);
  EXPECT_NEAR(shares.at("y").at(0).get<double>(), 99.9, 1e-9);

  const std::string page = with_document("<a id=\"document\"></a>", document);
  EXPECT_THAT(page, HasSubstr(R"(id="document">{"title":"<\/script>",)"));
  EXPECT_THAT(page, EndsWith("]]}}]}</a>"));
  EXPECT_THROW(with_document("<html></html>", document), InputError);
}

TEST(TimeSeries, StaysBoundedAndKeepsItsSums) {
  TimeSeries series(0);
  for (std::int64_t s = 0; s < 5000; ++s) ++series.at(s * 1'000'000).frames;
  EXPECT_LE(series.bins().size(), 600u);
  EXPECT_EQ(series.bin_s(), 16.0);
  EXPECT_EQ(series.sum(0.0, 1e9).frames, 5000u);
  EXPECT_EQ(series.sum(160.0, 320.0).frames, 160u);
}

}  // namespace
}  // namespace catgs::load
