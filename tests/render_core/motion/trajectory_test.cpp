#include "render_core/motion/trajectory.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/support/refusal.h"
#include "tests/support/shared_folder.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

class TumFile : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& text) const {
    return folder_.write("poses.tum", text);
  }

  const test::TemporaryFolder folder_;
};

TEST_F(TumFile, ReadsCommentsBlankLinesAndAnyWhiteSpace) {
  const Trajectory trajectory =
      read_tum(write("# timestamp tx ty tz qx qy qz qw\r\n\n"
                     "0.5 1 2 3 0 0 0 1\n"
                     "\t1.25  -1e-1 2 3   0 0.70710678 0 0.70710678  # turned\r\n"
                     "1403636580.838555 0 0 0 0 0 0 1"));
  ASSERT_EQ(trajectory.size(), 3u);
  EXPECT_EQ(trajectory[0].time_us, 500'000);
  EXPECT_EQ(trajectory[0].world_from_camera.position, glm::vec3(1, 2, 3));
  EXPECT_FLOAT_EQ(trajectory[1].world_from_camera.position.x, -0.1f);
  EXPECT_FLOAT_EQ(trajectory[1].world_from_camera.orientation.y, std::sqrt(0.5f));
  EXPECT_EQ(trajectory[2].time_us, 1'403'636'580'838'555);
}

TEST_F(TumFile, NormalisesQuaternions) {
  const Trajectory trajectory = read_tum(write("0 0 0 0 0.03 0 0 1.05\n"));
  EXPECT_NEAR(glm::length(trajectory[0].world_from_camera.orientation), 1.0f, 1e-6f);
}

TEST_F(TumFile, ErrorsNameTheLine) {
  const std::string good = "0 0 0 0 0 0 0 1\n";
  const auto where = [&](const std::string& text) {
    const auto path = write(text);
    const test::Refusal refusal = test::refusal_of([&] { read_tum(path); });
    EXPECT_EQ(refusal.source, path.string());
    return refusal.where;
  };
  for (const char* line :
       {"1 0 0 0 0 0 1", "1 0 0 0 0 0 0 1 9", "1 0 0 x 0 0 0 1", "1 0 0 nan 0 0 0 1",
        "1 0 0 1e999 0 0 0 1", "1 0 0 0 0 0 0 0", "1 0 0 0 1 1 1 1", "1 0 0 -9e93 0 0 0 1",
        "1e300 0 0 0 0 0 0 1", "9.00001e9 0 0 0 0 0 0 1", "1 0 1.00001e9 0 0 0 0 1"})
    EXPECT_EQ(where(good + line + "\n"), "line 2") << line;
  EXPECT_EQ(where(good + "\n" + good), "line 3") << "the time stamp does not increase";
  EXPECT_EQ(where(good + std::string(1024, ' ')), "line 2");
  EXPECT_EQ(where("# nothing\n"), "");
  EXPECT_NO_THROW(read_tum(write(good + std::string(1023, ' '))));
  EXPECT_NO_THROW(read_tum(write("9e9 1e9 -1e9 0 0 0 0 1\n")));
  EXPECT_EQ(test::input_error([] { read_tum("/nonexistent/file.tum"); }),
            "/nonexistent/file.tum: cannot be opened (is it a readable file?)");
}

TEST_F(TumFile, RoundTripIsExact) {
  Trajectory written;
  for (int i = 0; i < 100; ++i) {
    const float x = 0.1f * static_cast<float>(i) + 1e-7f;
    written.push_back(
        {i * 8'333, {glm::vec3(x, -x, x * x), glm::angleAxis(x, glm::vec3(0, 1, 0))}});
  }
  const std::filesystem::path path = folder_ / "poses.tum";
  write_tum(path, written);
  const Trajectory read = read_tum(path);
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].time_us, written[i].time_us);
    EXPECT_EQ(read[i].world_from_camera.position, written[i].world_from_camera.position);
    EXPECT_GT(
        glm::dot(read[i].world_from_camera.orientation, written[i].world_from_camera.orientation),
        1.0f - 1e-6f);
  }
}

TEST(SharedTraces, AllAreRead) {
  const auto traces = test::shared_folder("traces");
  if (traces.empty()) GTEST_SKIP() << "no shared folder traces";
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(traces)) {
    if (entry.path().extension() != ".tum") continue;
    EXPECT_GE(read_tum(entry.path()).size(), 1000u) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 1);
}

TEST(Interpolate, IsLinearAndTakesTheShortWayAndClamps) {
  const glm::quat start(1, 0, 0, 0);
  const glm::quat turned = glm::angleAxis(0.8f, glm::vec3(0, 1, 0));
  const Trajectory trajectory = {{100, {glm::vec3(0), start}},
                                 {300, {glm::vec3(2, 0, 4), -turned}}};
  const Pose middle = interpolate(trajectory, 200);
  EXPECT_EQ(middle.position, glm::vec3(1, 0, 2));
  const glm::quat expected = glm::angleAxis(0.4f, glm::vec3(0, 1, 0));
  EXPECT_NEAR(std::abs(glm::dot(middle.orientation, expected)), 1.0f, 1e-6f);
  EXPECT_EQ(interpolate(trajectory, 0).position, glm::vec3(0));
  EXPECT_EQ(interpolate(trajectory, 100).position, glm::vec3(0));
  EXPECT_EQ(interpolate(trajectory, 300).position, glm::vec3(2, 0, 4));
  EXPECT_EQ(interpolate(trajectory, 900).position, glm::vec3(2, 0, 4));
  EXPECT_THROW(interpolate({}, 0), std::invalid_argument);
}

TEST(Resample, KeepsTheEndsAndTheRate) {
  const Trajectory trajectory = {{1'000'000, {glm::vec3(0), {1, 0, 0, 0}}},
                                 {1'300'000, {glm::vec3(3, 0, 0), {1, 0, 0, 0}}},
                                 {2'000'000, {glm::vec3(10, 0, 0), {1, 0, 0, 0}}}};
  const Trajectory resampled = resample(trajectory, 10.0);
  ASSERT_EQ(resampled.size(), 11u);
  for (std::size_t i = 0; i < resampled.size(); ++i) {
    EXPECT_EQ(resampled[i].time_us, 1'000'000 + 100'000 * static_cast<std::int64_t>(i));
    EXPECT_NEAR(resampled[i].world_from_camera.position.x, static_cast<float>(i), 1e-5f);
  }
  EXPECT_THROW(resample(trajectory, 0.0), InputError);
  EXPECT_THROW(resample(trajectory, std::nan("")), InputError);
  EXPECT_THROW(resample(trajectory, 1e12), InputError);
  EXPECT_TRUE(resample({}, 60.0).empty());
}

}  // namespace
}  // namespace catgs
