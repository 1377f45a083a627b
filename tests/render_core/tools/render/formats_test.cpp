// catgs-render formats.
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/render_core/tools/catgs_render.h"

namespace catgs {
namespace {

using test::CatgsRender;
using test::Outcome;
using test::run;
using ::testing::HasSubstr;
using Json = nlohmann::json;

TEST_F(CatgsRender, FormatsMeasuresEachThatIsWritten) {
  const Outcome outcome = run(fmt::format("formats {} --threads 2 --json -", scene()));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json.at("gaussians"), 400);
  for (const char* format : {".ply", ".glb", ".spz", ".splat", ".sog"}) {
    const Json& trial = json.at("formats").at(format);
    EXPECT_GT(trial.at("mb"), 0.0) << format;
    for (const char* step : {"write", "read"})
      EXPECT_GT(trial.at(step).at("processor_seconds"), 0.0) << format;
  }
  const auto largest = [&](const char* format, std::size_t attribute) {
    return json.at("formats").at(format).at("errors").at("max").at(attribute).get<double>();
  };
  EXPECT_EQ(largest(".ply", 0), 0.0);
  EXPECT_LE(largest(".ply", 3), 1e-6);
  EXPECT_GT(largest(".splat", 3), 1e-6);
  EXPECT_LE(largest(".splat", 3), 0.5 / 255 + 1e-6);
}

TEST_F(CatgsRender, FormatsPrintsTables) {
  const Outcome outcome = run(fmt::format("formats {}", scene()));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("| .sog |"));
  EXPECT_THAT(outcome.out, HasSubstr("Largest error"));
  EXPECT_EQ(run("formats " + path("none.ply")).exit_code, 2);
}

}  // namespace
}  // namespace catgs
