// Tables of the paper as text and JSON, and how those of several scenes become one.
#include "render_core/tools/table.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/tools/paper/paper_case.h"
#include "render_core/tools/paper/paper_tables.h"

namespace catgs {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using Json = nlohmann::ordered_json;

constexpr double infinite = std::numeric_limits<double>::infinity();

PaperTable small_table(const std::string& column, double a, double b) {
  return {.title = {},
          .corner = "FPS",
          .columns = {column},
          .rows = {{"A", {{a, 1}}}, {"B", {{b, 2, "×"}}}},
          .notes = {"same", "of " + column}};
}

TEST(PaperTable, NumbersAreWrittenForPeople) {
  EXPECT_EQ(text({1234567.0, 0}), "1,234,567");
  EXPECT_EQ(text({-123456.75, 2}), "-123,456.75");
  EXPECT_EQ(text({999.0, 0}), "999");
  EXPECT_EQ(text({999.96, 1}), "1,000.0");
  EXPECT_EQ(text({2.5, 2, "×"}), "2.50×");
  EXPECT_EQ(text({}), "–");
  EXPECT_EQ(text({infinite, 2, " dB"}), "∞");
}

TEST(PaperTable, MarkdownHasARowPerRow) {
  EXPECT_EQ(markdown(small_table("a|b", 10.0, 0.5)),
            "| FPS | a\\|b |\n"
            "|---|---:|\n"
            "| A | 10.0 |\n"
            "| B | 0.50× |\n"
            "\n- same\n- of a|b\n");
}

TEST(PaperTable, JsonHasNullForWhatIsNotFinite) {
  const Json json = to_json(small_table("city", Number::nothing, infinite));
  EXPECT_TRUE(json.at("rows").at("A").at("city").is_null());
  EXPECT_TRUE(json.at("rows").at("B").at("city").is_null());
  EXPECT_EQ(to_json(small_table("city", 2.5, 1.0)).at("rows").at("A").at("city"), 2.5);
}

TEST(PaperTable, ScenesStandSideBySide) {
  const PaperTable table =
      joined(std::vector{small_table("city", 1.0, 2.0), small_table("garden", 3.0, 4.0)});
  EXPECT_THAT(table.columns, ElementsAre("city", "garden"));
  EXPECT_EQ(table.rows[1].numbers[0].value, 2.0);
  EXPECT_EQ(table.rows[1].numbers[1].value, 4.0);
  EXPECT_THAT(table.notes, ElementsAre("same", "of city", "of garden"));
}

TEST(PaperTable, AveragesAreGeometricAndSkipWhatIsMissing) {
  const PaperTable table = averaged(std::vector{small_table("speed-up", 2.0, 5.0),
                                                small_table("speed-up", 8.0, Number::nothing)});
  EXPECT_DOUBLE_EQ(table.rows[0].numbers[0].value, 4.0);
  EXPECT_DOUBLE_EQ(table.rows[1].numbers[0].value, 5.0);
  EXPECT_THAT(table.title, HasSubstr("2 scenes"));
}

TEST(PaperTable, RowsMeasuredElsewhereStandBehindTheirRow) {
  PaperTable table = small_table("city", 1.0, 2.0);
  add_rows(table, 0, Json::parse(R"({"X": {"city": 7, "other": 8}, "Y": {"city": 9}})"), "b.json");
  ASSERT_EQ(table.rows.size(), 4u);
  EXPECT_EQ(table.rows[1].name, "X");
  EXPECT_EQ(table.rows[1].numbers[0].value, 7.0);
  EXPECT_EQ(table.rows[1].numbers[0].decimals, 1);
  EXPECT_EQ(table.rows[2].name, "Y");
  EXPECT_EQ(table.rows[3].name, "B");
}

TEST(PaperTable, RowsMeasuredElsewhereMustFit) {
  const auto refuses = [](const char* rows, const std::string& message) {
    PaperTable table = small_table("city", 1.0, 2.0);
    EXPECT_THAT([&] { add_rows(table, 0, Json::parse(rows), "b.json"); },
                ThrowsMessage<InputError>(HasSubstr(message)))
        << rows;
    EXPECT_EQ(table.rows.size(), 2u);
  };
  refuses("[1]", "b.json: is not an object of rows");
  refuses(R"({"X": 1})", "X: is not an object of columns");
  refuses(R"({"X": {"city": "fast"}})", "X: is not a number");
  refuses(R"({"X": {"ctiy": 7}})", "they are called city");
}

TEST(PaperCases, AreCalledAsTheirScenes) {
  EXPECT_THAT(case_labels({{"a/city.ply", "walk"}, {"room/", "head"}}),
              ElementsAre("city", "room"));
  EXPECT_THAT(case_labels({{"city.ply", "t/walk.tum"}, {"city.ply", "t/pan.tum", "head"}}),
              ElementsAre("city walk", "city pan head"));
  EXPECT_THAT(case_labels({{"a/room/lod-meta.json"}, {"b/hall/meta.json"}}),
              ElementsAre("room", "hall"));
  EXPECT_THAT(case_labels({{"city.ply", "walk"}, {"b/city.ply", "walk"}}),
              ElementsAre("city walk", "city walk (2)"));
}

Measurement::Frame frame(FrameKind kind, std::uint64_t entries, int window) {
  Measurement::Frame frame;
  frame.stats.kind = kind;
  frame.stats.list_entries = entries;
  frame.stats.window = window;
  return frame;
}

TEST(KeyListGrowth, ComparesKeyFramesWithTheSameFramesOfExact) {
  Measurement ours, exact;
  ours.frames = {frame(FrameKind::key, 110, 1), frame(FrameKind::sub, 110, 1),
                 frame(FrameKind::key, 330, 1), frame(FrameKind::key, 900, 0)};
  exact.frames = {frame(FrameKind::key, 100, 0), frame(FrameKind::key, 5, 0),
                  frame(FrameKind::key, 300, 0), frame(FrameKind::key, 900, 0)};
  const auto with_window = [](const FrameStats& stats) { return stats.window == 1; };
  EXPECT_DOUBLE_EQ(key_list_growth({ours}, {exact}, with_window), 1.1);
  EXPECT_DOUBLE_EQ(key_list_growth({exact, ours}, {exact, exact}, with_window), 1.1);
  EXPECT_TRUE(std::isnan(
      key_list_growth({ours}, {exact}, [](const FrameStats& stats) { return stats.window == 9; })));
}

TEST(Pooled, AllTracesCountByTheirFrames) {
  Measurement a, b;
  a.frames.resize(10);
  a.wall_ms = 100.0;
  b.frames.resize(30);
  b.wall_ms = 100.0;
  EXPECT_DOUBLE_EQ(pooled({a, b}).fps(), 200.0);
}

}  // namespace
}  // namespace catgs
