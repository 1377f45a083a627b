// catgs-render paper on small scenes: rows and columns of each table, and values that follow from
// what the pipelines are.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/render_core/tools/paper/paper_fixture.h"

namespace catgs {
namespace {

using test::glide;
using test::Outcome;
using test::Paper;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using Json = nlohmann::ordered_json;

TEST_F(Paper, FpsHasAColumnPerScene) {
  std::ofstream(path("flash.json")) << R"({"FlashGS": {"cloud": 123.5}, "Slow": {"cloud": 2}})";
  const Json rows = tables("fps", "--baseline " + path("flash.json")).at(0).at("rows");
  EXPECT_THAT(names(rows),
              ElementsAre("Model size", "3DGS", "FlashGS", "Slow", "Exact", "Paper-w/o cache",
                          "Paper", "Ours", "Ours over 3DGS", "Ours over the best of these"));
  for (const auto& [name, row] : rows.items())
    EXPECT_THAT(names(row), ElementsAre("cloud", "mist"));
  EXPECT_EQ(rows.at("Model size").at("mist"), 500);
  EXPECT_EQ(rows.at("FlashGS").at("cloud"), 123.5);
  EXPECT_TRUE(rows.at("FlashGS").at("mist").is_null());
  const Json& lead = rows.at("Ours over the best of these");
  EXPECT_DOUBLE_EQ(lead.at("cloud").get<double>(),
                   rows.at("Ours").at("cloud").get<double>() / 123.5);
  EXPECT_TRUE(lead.at("mist").is_null());
  EXPECT_DOUBLE_EQ(
      rows.at("Ours over 3DGS").at("cloud").get<double>(),
      rows.at("Ours").at("cloud").get<double>() / rows.at("3DGS").at("cloud").get<double>());
}

TEST_F(Paper, PrintsMarkdownAndWritesJson) {
  const Outcome outcome =
      paper(fmt::format("--table list,ablation {} --json {}", both_cases(), path("tables.json")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, StartsWith("## Impact of the major mechanisms\n\n"
                                      "| Average FPS | cloud | mist |\n|---|---:|---:|\n"
                                      "| Ours-Full | "));
  EXPECT_THAT(outcome.out, HasSubstr("| List length (10³) | cloud | mist |\n"));
  EXPECT_THAT(outcome.out, HasSubstr("\n96x64, focal length "));
  std::ifstream file(path("tables.json"));
  const Json json = Json::parse(file);
  EXPECT_THAT(names(json.at("tables")), ElementsAre("ablation", "list"));
  EXPECT_EQ(json.at("cases").at(0).at("gaussians"), 2000);
  EXPECT_EQ(json.at("settings").at("size_px"), (Json{96, 64}));
  EXPECT_TRUE(json.at("settings").at("seed").is_null());
}

TEST_F(Paper, TheReportHoldsTheScriptsSeedAndDuration) {
  const Outcome outcome =
      paper(fmt::format("--table list {} head --seed 3 --duration 0.1 --json -", cloud_case()));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const Json settings = Json::parse(outcome.out).at("settings");
  EXPECT_EQ(settings.at("seed"), 3);
  EXPECT_EQ(settings.at("duration_s"), 0.1);
  EXPECT_EQ(settings.at("warmup"), 10);
}

TEST_F(Paper, OptionsOfScriptsAreRefusedWithoutOne) {
  const Outcome outcome = paper(fmt::format("--table list {} --seed 3", cloud_case()));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.out, HasSubstr("--seed: has no effect on a recorded trace"));
}

TEST_F(Paper, OptionsThatWouldChangeNothingAreRefused) {
  const auto complaint = [&](const std::string& arguments) {
    const Outcome outcome = paper(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    return outcome.out;
  };
  for (const char* option :
       {"--baseline x", "--images x", "--keep-fraction 1", "--variant '--window 2'", "--every 2",
        "--images x --image-rate 5", "--images x --llffhold 2"}) {
    EXPECT_THAT(complaint(fmt::format("--table list {} {}", cloud_case(), option)),
                HasSubstr("has no effect on the requested tables (it belongs to --table"))
        << option;
  }
  EXPECT_THAT(complaint(fmt::format("--table quality {} --image-rate 5", cloud_case())),
              HasSubstr("--image-rate requires --images"));
  EXPECT_THAT(complaint(fmt::format("--table list {} --warmup 41", cloud_case())),
              HasSubstr("--warmup: 41 frames of a path of 40"));
}

TEST_F(Paper, AblationTakesOnePartAwayAtATime) {
  const Json ablation = tables(
      "ablation", "--window 6 --variant '--window 2' --variant '--max-trail-px 20 --no-split'");
  ASSERT_EQ(ablation.size(), 3u);  // both scenes, then each
  const Json& fps = ablation.at(0).at("rows");
  EXPECT_THAT(names(fps), ElementsAre("Ours-Full", "Ours-w/o colour cache", "Ours-w/o split",
                                      "Paper", "Paper-w/o cache", "Paper-w/o doubt",
                                      "Paper --window 2", "Paper --max-trail-px 20 --no-split"));
  EXPECT_THAT(names(fps.at("Ours-Full")), ElementsAre("cloud", "mist"));
  const Json& rows = ablation.at(1).at("rows");
  EXPECT_EQ(ablation.at(1).at("title"), "cloud");
  EXPECT_EQ(rows.at("Ours-Full").at("Average FPS"), fps.at("Ours-Full").at("cloud"));
  EXPECT_EQ(rows.at("Ours-Full").at("of Full"), 1.0);
  EXPECT_EQ(rows.at("Paper-w/o cache").at("Frames per key"), 1.0);
  EXPECT_EQ(rows.at("Paper-w/o cache").at("Keys without window"), 100.0);
  EXPECT_TRUE(rows.at("Paper-w/o cache").at("Sub-frame ms").is_null());
  // Of 40 frames two know no motion yet; then come groups of 7, or of 3.
  EXPECT_DOUBLE_EQ(rows.at("Paper").at("Frames per key").get<double>(), 40.0 / 8);
  EXPECT_DOUBLE_EQ(rows.at("Paper --window 2").at("Frames per key").get<double>(), 40.0 / 15);
  EXPECT_EQ(rows.at("Paper --max-trail-px 20 --no-split").at("Frames per key"),
            rows.at("Paper").at("Frames per key"));
}

TEST_F(Paper, ListsGrowFromExactToTheBoxes) {
  const Json rows = tables("list").at(0).at("rows");
  EXPECT_THAT(names(rows), ElementsAre("3DGS", "Exact", "Paper-key", "Paper-sub",
                                       "Paper-key over Exact", "Ours"));
  for (const char* scene : {"cloud", "mist"}) {
    const double exact = rows.at("Exact").at(scene).get<double>();
    EXPECT_GT(exact, 0.0);
    EXPECT_LT(exact, rows.at("3DGS").at(scene).get<double>());
    EXPECT_GT(rows.at("Paper-key over Exact").at(scene).get<double>(), 1.0);
    EXPECT_FALSE(rows.at("Paper-sub").at(scene).is_null());
    EXPECT_LE(rows.at("Ours").at(scene).get<double>(), exact);
  }
}

TEST_F(Paper, LongerWindowsHaveLongerTrailsAndLists) {
  const Json windows = tables("window");
  ASSERT_EQ(windows.size(), 2u);
  EXPECT_EQ(windows.at(0).at("title"), "cloud");
  const Json& rows = windows.at(0).at("rows");
  const Json& growth = rows.at("Over Exact");
  const Json& trail = rows.at("Mean trail (px)");
  EXPECT_THAT(names(growth), ElementsAre("Exact", "None", "W-1", "W-2", "W-4", "W-8", "W-16"));
  EXPECT_EQ(growth.at("None"), 1.0);
  const std::vector<std::string> columns = {"W-1", "W-2", "W-4", "W-8"};
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const double before = i == 0 ? 1.0 : growth.at(columns[i - 1]).get<double>();
    EXPECT_GT(growth.at(columns[i]).get<double>(), before) << columns[i];
    // At 0.004 units a frame a trail is proportional to the window, but for who is in the picture.
    const double unit = trail.at("W-1").get<double>();
    EXPECT_NEAR(trail.at(columns[i]).get<double>() / unit, 1 << i, 0.02 * (1 << i)) << columns[i];
  }
}

TEST_F(Paper, TracesStandByThemselvesAndTogether) {
  write_tum(folder_ / "brief.tum", glide(20));
  const Outcome outcome = paper(
      fmt::format("--table traces {} {} --every 2 --json -", cloud_case(), path("brief.tum")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const Json table = Json::parse(outcome.out).at("tables").at("traces").at(0);
  const Json& rows = table.at("rows");
  EXPECT_THAT(names(rows), ElementsAre("glide", "brief", "All"));
  const auto value = [&](const char* trace, const char* column) {
    return rows.at(trace).at(column).get<double>();
  };
  EXPECT_NEAR(value("glide", "Ours over Exact"),
              value("glide", "Ours FPS") / value("glide", "Exact FPS"), 1e-9);
  for (const char* column : {"Worst frame dB", "Worst block dB", "0.1 % block dB"}) {
    EXPECT_EQ(value("All", column), std::min(value("glide", column), value("brief", column)));
  }
  EXPECT_GE(value("All", "Mean dB"), value("All", "Worst frame dB"));
}

TEST_F(Paper, ScalingComparesWithTheFirstScene) {
  const Json tables_of = tables("scaling");
  ASSERT_EQ(tables_of.size(), 1u);
  const Json& rows = tables_of.at(0).at("rows");
  const auto value = [&](const char* row, const char* scene) {
    return rows.at(row).at(scene).get<double>();
  };
  EXPECT_EQ(value("Gaussians (10³)", "cloud"), 2.0);
  EXPECT_EQ(value("Gaussians (10³)", "mist"), 0.5);
  EXPECT_EQ(value("In view over the first", "cloud"), 1.0);
  EXPECT_NEAR(value("In view over the first", "mist"),
              value("In view (10³)", "mist") / value("In view (10³)", "cloud"), 1e-9);
  for (const char* row : {"Key frame", "Sub-frame"}) {
    EXPECT_NEAR(value(fmt::format("{} over the first", row).c_str(), "mist"),
                value(fmt::format("{} ms", row).c_str(), "mist") /
                    value(fmt::format("{} ms", row).c_str(), "cloud"),
                1e-9);
  }
  EXPECT_NEAR(value("Scene bytes per Gaussian", "cloud") * 2e-3, value("Scene MB", "cloud"), 1e-9);
  EXPECT_GT(value("View MB", "mist"), 0.0);
}

TEST_F(Paper, QualityAgainstExactIsBestForKeyFrames) {
  const Json rows = tables("quality", "--every 2").at(0).at("rows");
  EXPECT_THAT(names(rows), ElementsAre("3DGS", "Paper-key", "Paper-sub", "Ours"));
  EXPECT_THAT(names(rows.at("3DGS")), ElementsAre("cloud PSNR", "cloud SSIM", "cloud worst PSNR",
                                                  "mist PSNR", "mist SSIM", "mist worst PSNR"));
  const auto psnr = [&](const char* row) {
    const Json& value = rows.at(row).at("cloud PSNR");
    return value.is_null() ? 1e3 : value.get<double>();
  };
  EXPECT_GE(psnr("Paper-key"), 75.0);  // colours are kept while they hold
  EXPECT_GE(psnr("Paper-sub"), 50.0);
  EXPECT_GE(psnr("Ours"), 50.0);
  EXPECT_LT(psnr("3DGS"), psnr("Paper-key"));
}

TEST_F(Paper, StagesAreSpeedUpsOver3dgs) {
  const Json stages = tables("stages");
  ASSERT_EQ(stages.size(), 3u);  // the mean, then each scene
  EXPECT_THAT(stages.at(0).at("title").get<std::string>(), HasSubstr("2 scenes"));
  for (const Json& table : stages) {
    const Json& rows = table.at("rows");
    EXPECT_THAT(names(rows), ElementsAre("3DGS", "Exact", "Paper-key", "Paper-sub", "Ours"));
    EXPECT_THAT(names(rows.at("Paper-sub")),
                ElementsAre("Pre-processing", "Sorting", "Tile Identify", "Rasterization"));
    EXPECT_DOUBLE_EQ(rows.at("3DGS").at("Sorting").get<double>(), 1.0);
    EXPECT_GT(rows.at("Paper-sub").at("Rasterization").get<double>(), 0.0);
  }
}

TEST_F(Paper, TilesAddUpToTheLists) {
  const Json rows = tables("tiles", "--every 1").at(0).at("rows");
  const Json lists = tables("list").at(0).at("rows");
  EXPECT_EQ(rows.at("Tiles").at("cloud Exact"), 6 * 4);
  EXPECT_NEAR(rows.at("Mean list").at("cloud Exact").get<double>() * 6 * 4,
              1000.0 * lists.at("Exact").at("cloud").get<double>(), 1e-6);
  EXPECT_NEAR(rows.at("Mean list").at("cloud 3DGS").get<double>() * 6 * 4,
              1000.0 * lists.at("3DGS").at("cloud").get<double>(), 1e-6);
  for (const char* column : {"cloud 3DGS", "cloud Exact", "mist 3DGS", "mist Exact"}) {
    const auto value = [&](const char* row) { return rows.at(row).at(column).get<double>(); };
    EXPECT_LE(value("50 % of the tiles hold at most"), value("90 %"));
    EXPECT_LE(value("99 %"), value("Longest list"));
    EXPECT_GE(value("Share of the busiest 10 %"), 100.0 * 3 / 24);  // 3 of 24 tiles, if all equal
    EXPECT_LE(value("Share of the busiest 10 %"), 100.0);
  }
}

TEST_F(Paper, PrunedKeepsTheShares) {
  const Json rows = tables("pruned", "--keep-fraction 1,0.25").at(0).at("rows");
  EXPECT_THAT(names(rows), ElementsAre("Size (10³)", "3DGS", "Exact", "Ours"));
  EXPECT_THAT(names(rows.at("Ours")),
              ElementsAre("cloud 100 %", "cloud 25 %", "mist 100 %", "mist 25 %"));
  EXPECT_DOUBLE_EQ(rows.at("Size (10³)").at("cloud 100 %").get<double>(), 2.0);
  EXPECT_DOUBLE_EQ(rows.at("Size (10³)").at("cloud 25 %").get<double>(), 0.5);
}

TEST_F(Paper, BadInputExitsWithTwoAndSaysWhatToDo) {
  const auto expect = [](const Outcome& outcome, const std::string& message) {
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_THAT(outcome.out, HasSubstr(message));
  };
  expect(paper(cloud_case()), "--table is required");
  expect(paper("--table fps"), "--case is required");
  expect(paper("--table speed " + cloud_case()), "speed not in");
  expect(paper("--table fps --case " + path("none.ply")), "none.ply: does not exist");
  std::ofstream(path("none.ply")) << "no scene";
  expect(paper("--table fps --case " + path("none.ply")),
         "catgs-render: --case: none: has no trace");
  expect(paper(fmt::format("--table quality {} --images /nofolder", cloud_case())),
         "/nofolder: does not exist (--images takes the folder of a COLMAP reconstruction)");
  expect(paper(fmt::format("--table fps --case {} none.tum", path("cloud.ply"))),
         "none.tum: does not exist");
  expect(paper(fmt::format("--table quality {} --images {} {}", cloud_case(), path(""), path(""))),
         "--images: 2 folders for 1 scenes");
  expect(paper(fmt::format("--table quality {} --images {}", cloud_case(), path(""))),
         "has no COLMAP reconstruction");
  expect(paper(fmt::format("--table pruned --keep-fraction 0 {}", cloud_case())),
         "--keep-fraction: 0 is not in (0, 1]");
  expect(paper(fmt::format("--table ablation {} --variant '--windows 2'", cloud_case())),
         "--variant: --windows 2: ");
  expect(paper(fmt::format("--table ablation {} --variant '--pipeline exact'", cloud_case())),
         "selects another pipeline");
  expect(paper(fmt::format("--table ablation {} --variant '--window 99'", cloud_case())),
         "--window: is out of range");
}

TEST_F(Paper, OutputsAndBaselineAreReadBeforeAnythingIsLoaded) {
  std::ofstream(path("none.ply")) << "no scene";
  const std::string fps =
      fmt::format("--table fps --case {} {} ", path("none.ply"), path("glide.tum"));
  const auto complaint = [&](const std::string& more) {
    const Outcome outcome = paper(fps + more);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    return outcome.out;
  };
  EXPECT_THAT(complaint(""), HasSubstr("none.ply: "));
  const std::string nowhere = path("no/tables.json");
  EXPECT_THAT(complaint("--json " + nowhere), HasSubstr(nowhere + ": cannot be written"));
  const auto baseline = [&](const char* text) {
    std::ofstream(path("bad.json")) << text;
    return complaint("--baseline " + path("bad.json"));
  };
  EXPECT_THAT(baseline(R"({"FlashGS": {"clod": 1}})"),
              HasSubstr("FlashGS: has none of the columns (they are called none)"));
  EXPECT_THAT(baseline(R"({"FlashGS": {"none": "fast"}})"),
              HasSubstr("is not a number everywhere"));
  EXPECT_THAT(baseline("{"), HasSubstr("is not JSON"));

  std::ofstream(path("tables.json")) << "old";
  EXPECT_THAT(complaint("--json " + path("tables.json")), HasSubstr("none.ply: "));
  std::string kept;
  std::ifstream(path("tables.json")) >> kept;
  EXPECT_EQ(kept, "old");
}

}  // namespace
}  // namespace catgs
