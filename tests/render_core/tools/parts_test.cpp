#include <array>
#include <cmath>
#include <limits>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/command_line.h"
#include "render_core/base/error.h"
#include "render_core/tools/bench/bench_measure.h"
#include "render_core/tools/bench/bench_quality.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/pipeline_options.h"
#include "render_core/tools/render_setup.h"
#include "render_core/tools/scene_hash.h"

namespace catgs {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(MissingBenchmarks, AreListedAndSayHowToAddThem) {
  for (const std::string command : {"bench", "compare", "paper", "trace"}) {
    CLI::App app;
    app.fallthrough();  // as catgs-render
    add_missing_benchmarks(app);
    const std::array words{"catgs-render", command.c_str(), "anchor", "--unknown", "1", "city.ply"};
    EXPECT_THAT(app.help(), HasSubstr(command));
    EXPECT_THAT([&] { parse_command_line(app, static_cast<int>(words.size()), words.data()); },
                ThrowsMessage<InputError>(HasSubstr("-DCATGS_BENCHMARKS=ON")));
  }
}

TEST(ParseSize, TakesWidthAndHeight) {
  EXPECT_EQ(parse_size("--size", "1920x1080"), glm::ivec2(1920, 1080));
  EXPECT_EQ(parse_size("--size", "1x8192"), glm::ivec2(1, 8192));
  for (const char* bad : {"", "x", "10", "10x", "x10", "10x0", "-1x5", "8193x1", "1x1x1", "1 x1",
                          "99999999999x1", "1.5x2"}) {
    EXPECT_THAT([&] { parse_size("--size", bad); },
                ThrowsMessage<InputError>(HasSubstr("--size: \"" + std::string(bad) + "\"")))
        << bad;
  }
}

TEST(ParseFrameRange, TakesOpenEndsAndClampsTheEnd) {
  const auto expect = [](std::string_view text, std::size_t begin, std::size_t end) {
    const FrameRange range = parse_frame_range(text, 10);
    EXPECT_EQ(range.begin, begin) << text;
    EXPECT_EQ(range.end, end) << text;
  };
  expect("", 0, 10);
  expect(":", 0, 10);
  expect("3:", 3, 10);
  expect(":4", 0, 4);
  expect("2:5", 2, 5);
  expect("2:500", 2, 10);
  for (const char* bad : {"3", "a:b", "5:5", "6:2", "10:", "-1:3", "1:2:3"}) {
    EXPECT_THROW(parse_frame_range(bad, 10), InputError) << bad;
  }
}

TEST(PipelineOptions, BecomeViewSettings) {
  PipelineOptions options;
  EXPECT_EQ(view_settings(options).pipeline, Pipeline::exact);
  EXPECT_TRUE(view_settings(options).split_tasks);
  EXPECT_TRUE(view_settings(options).colour_cache);
  options.pipeline = "paper";
  options.window = 8;
  options.max_trail_px = 20.0f;
  options.min_depth = 0.4f;
  options.no_split = true;
  options.no_colour_cache = true;
  const ViewSettings settings = view_settings(options);
  EXPECT_EQ(settings.pipeline, Pipeline::paper);
  EXPECT_EQ(settings.speculation.initial_window, 8);
  EXPECT_EQ(settings.speculation.max_trail_px, 20.0f);
  EXPECT_EQ(settings.speculation.min_depth, 0.4f);
  EXPECT_EQ(settings.speculation.max_deviation_px, SpeculationSettings{}.max_deviation_px);
  EXPECT_FALSE(settings.split_tasks);
  EXPECT_FALSE(settings.colour_cache);
  EXPECT_EQ(view_settings({.pipeline = "paper", .no_cache = true}).speculation.initial_window, 0);
  EXPECT_EQ(predictor_settings({}).min_confidence, 0.0);
  EXPECT_EQ(predictor_settings({.constant_velocity = true}).min_confidence, 1.0);
}

TEST(PipelineOptions, RefuseWhatWouldChangeNothing) {
  const auto refused = [](const PipelineOptions& options, const std::string& message) {
    EXPECT_THAT([&] { view_settings(options); }, ThrowsMessage<InputError>(HasSubstr(message)));
  };
  refused({.pipeline = "fast"},
          "--pipeline: unknown \"fast\" (one of exact, vanilla, paper, catgs)");
  refused({.pipeline = "paper", .window = 65}, "--window: is out of range");
  refused({.pipeline = "vanilla", .window = 0}, "--window: has no effect on the vanilla pipeline");
  refused({.window = 4}, "--window: has no effect on the exact pipeline");
  refused({.pipeline = "exact", .min_depth = 1.0f}, "--min-depth: has no effect on the exact");
  refused({.no_colour_cache = true}, "--no-colour-cache: has no effect on the exact pipeline");
  refused({.no_cache = true}, "--no-cache: has no effect");
  refused({.constant_velocity = true}, "--constant-velocity: has no effect");
}

GaussianCloud small_cloud() {
  GaussianCloud cloud;
  cloud.resize(5, 1);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean[i] = glm::vec3(static_cast<float>(i), 1, 2);
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.scale[i] = glm::vec3(0.1f);
    cloud.opacity[i] = 0.5f;
  }
  return cloud;
}

TEST(SceneHash, SeesEveryArray) {
  const std::uint64_t hash = scene_hash(small_cloud());
  EXPECT_EQ(scene_hash(small_cloud()), hash);
  GaussianCloud changed = small_cloud();
  changed.mean[4].z = 2.0000002f;
  EXPECT_NE(scene_hash(changed), hash);
  changed = small_cloud();
  changed.rotation[0].x = -0.0f;
  EXPECT_NE(scene_hash(changed), hash);
  changed = small_cloud();
  std::swap(changed.scale[1].x, changed.opacity[1]);
  EXPECT_NE(scene_hash(changed), hash);
  changed = small_cloud();
  changed.sh.back().z = 1.0f;
  EXPECT_NE(scene_hash(changed), hash);
  changed = small_cloud();
  changed.resize(4, 1);
  EXPECT_NE(scene_hash(changed), hash);
}

TEST(QualityTally, MeanIsThePsnrOfTheMeanError) {
  ImageQuality good, bad;
  good.mean_squared_error = 1e-6;
  good.ssim = 0.99;
  good.block_errors = {1e-7, 1e-5};
  bad.mean_squared_error = 3e-4;
  bad.ssim = 0.91;
  bad.block_errors = {1e-4, 1e-3};
  QualityTally tally;
  tally.add(good, 3);
  tally.add(bad, 7);
  EXPECT_EQ(tally.frames(), 2u);
  EXPECT_EQ(tally.worst_frame(), 7u);
  EXPECT_NEAR(tally.mean_psnr(), -10.0 * std::log10(0.5 * (1e-6 + 3e-4)), 1e-9);
  EXPECT_NEAR(tally.min_psnr(), -10.0 * std::log10(3e-4), 1e-9);
  EXPECT_NEAR(tally.mean_ssim(), 0.95, 1e-12);
  EXPECT_NEAR(tally.min_ssim(), 0.91, 1e-12);
  EXPECT_NEAR(tally.worst_block_psnr(), 30.0, 1e-9);
  EXPECT_EQ(tally.worst_block_frame(), 7u);
  QualityTally all;
  all.add(tally);
  good.block_errors = {1e-7, 2e-3};  // one bad block in a good picture
  QualityTally speck;
  speck.add(good, 9);
  all.add(speck);
  EXPECT_EQ(all.worst_frame(), 7u);
  EXPECT_EQ(all.worst_block_frame(), 9u);
}

TEST(Measurement, SplitsByKindAndCountsTheWholePass) {
  Measurement measurement;
  for (int i = 0; i < 4; ++i) {
    FrameStats stats;
    stats.kind = i == 0 ? FrameKind::key : FrameKind::sub;
    stats.stage_ms[static_cast<std::size_t>(Stage::blend)] = static_cast<float>(i);
    measurement.frames.push_back({10.0 * i, stats});
  }
  measurement.wall_ms = 80.0;  // more than the frames' sum: work between them counts
  EXPECT_DOUBLE_EQ(measurement.fps(), 50.0);
  EXPECT_EQ(measurement.frame_ms(FrameKind::key), std::vector<double>{0.0});
  EXPECT_EQ(measurement.frame_ms(FrameKind::sub), (std::vector<double>{10.0, 20.0, 30.0}));
  EXPECT_DOUBLE_EQ(measurement.mean_stage_ms(Stage::blend), 1.5);
}

}  // namespace
}  // namespace catgs
