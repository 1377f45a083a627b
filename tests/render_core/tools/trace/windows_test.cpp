// catgs-render trace windows, on motion whose windows are known.
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/render_core/tools/glide.h"
#include "tests/render_core/tools/run_catgs_render.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using ::testing::HasSubstr;

class TraceWindows : public ::testing::Test {
 protected:
  void SetUp() override { write_tum(folder_ / "glide.tum", test::glide(2400)); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  const test::TemporaryFolder folder_;
};

TEST_F(TraceWindows, FollowThePapersRule) {
  const auto outcome =
      test::run("--quiet trace windows --trace " + path("glide.tum") + " " + path("glide.tum") +
                " --variant --no-cache --json " + path("windows.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out,
              HasSubstr("| Frames per key frame | 120 Hz | no window, 120 Hz | 60 Hz"));
  std::ifstream file(path("windows.json"));
  const auto json = nlohmann::json::parse(file);
  const auto& rows = json.at("table").at("rows");
  // A point 1 unit away moves 4.4 px a frame at 120 Hz. In 4 frames that is more than 16 px, so a
  // window is floor(4 * 16 / 17.6) = 3 frames; at 60 Hz it is 1, at 30 Hz none. The first frames
  // differ: the motion is not known yet.
  const auto& paper = rows.at("The paper's rule");
  EXPECT_NEAR(paper.at("120 Hz").get<double>(), 4.0, 0.04);
  EXPECT_NEAR(paper.at("60 Hz").get<double>(), 2.0, 0.02);
  EXPECT_NEAR(paper.at("30 Hz").get<double>(), 1.0, 0.01);
  EXPECT_LT(paper.at("no window, 120 Hz").get<double>(), 1.0);
  EXPECT_GT(paper.at("no window, 30 Hz").get<double>(), 99.0);
  EXPECT_EQ(rows.at("--no-cache").at("120 Hz"), 1.0);
  EXPECT_EQ(json.at("flags").at("--no-cache"), "--no-cache");
}

TEST_F(TraceWindows, AreLongerForWhatIsFarAway) {
  const auto outcome = test::run("--quiet trace windows --trace " + path("glide.tum") +
                                 " --fps 60 --nearest-depth 10 --json -");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const auto rows = nlohmann::json::parse(outcome.out).at("table").at("rows");
  EXPECT_NEAR(rows.at("The paper's rule").at("60 Hz").get<double>(), 5.0, 0.05);
}

TEST_F(TraceWindows, NameMistakes) {
  const auto expect = [&](const std::string& arguments, const std::string& message) {
    const auto outcome = test::run("trace windows --trace " + arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.out, HasSubstr(message));
  };
  expect(path("none.tum"), "none.tum: cannot be opened");
  expect(path("glide.tum") + " --variant '--pipeline exact'", "selects another pipeline");
  expect(path("glide.tum") + " --window 99", "--window: is out of range");
  expect(path("glide.tum") + " --fps 0", "--fps");
  expect(path("glide.tum") + " --nearest-depth 0", "--nearest-depth");
  expect(path("glide.tum") + " --size 12", "--size: \"12\" is not a picture size");
}

}  // namespace
}  // namespace catgs
