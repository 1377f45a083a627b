// The measuring parts of bench on a core whose errors are known.
#include <cmath>
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render_core/image/host_image.h"
#include "render_core/image/png.h"
#include "render_core/tools/bench/bench_measure.h"
#include "render_core/tools/bench/bench_quality.h"
#include "render_core/tools/frame_feed.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

constexpr glm::ivec2 size_px{64, 48};
constexpr float key_error = 0.001f;
constexpr float sub_error = 0.01f;

/// Grey that follows the camera; half of the background shows through. Key and sub-frames of the
/// paper pipeline are off by known errors.
class GreyView final : public View {
 public:
  GreyView(const ViewSettings& settings, std::vector<FrameRequest>* requests)
      : settings_(settings), groups_(settings.speculation), requests_(requests) {}

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override {
    FrameStats stats;
    float grey = 0.3f + request.camera.world_from_camera.position.x;
    if (settings_.pipeline == Pipeline::paper) {
      const FramePlan plan = groups_.plan(request.camera, request.forecast, 100.0f);
      stats.kind = plan.kind;
      stats.window = plan.window;
      grey += plan.kind == FrameKind::key ? key_error : sub_error;
      requests_->push_back(request);
    }
    stats.list_entries = stats.kind == FrameKind::key ? 100 : 50;
    stats.stage_ms.fill(stats.kind == FrameKind::key ? 3.0f : 1.0f);
    image_.resize(PixelFormat::rgb_f32, request.camera.size_px);
    for (int y = 0; y < request.camera.size_px.y; ++y) {
      float* row = image_.rgb_row(y);
      std::fill(row, row + 3 * request.camera.size_px.x, grey + 0.6f * request.background.x);
    }
    frame = {PixelFormat::rgb_f32, MemorySpace::host, request.camera.size_px, image_.planes(),
             stats};
    return {};
  }
  std::size_t memory_bytes() const override { return 77; }

 private:
  ViewSettings settings_;
  FrameGroups groups_;
  std::vector<FrameRequest>* requests_;
  HostImage image_;
};

class GreyRenderer final : public Renderer {
 public:
  std::string description() const override { return "grey"; }
  std::size_t scene_bytes() const override { return 0; }
  std::unique_ptr<View> make_view(const ViewSettings& settings) override {
    return std::make_unique<GreyView>(settings, &requests);
  }
  std::vector<FrameRequest> requests;  // of the paper pipeline
};

TimedPose at_x(std::int64_t time_us, float x) { return {time_us, {{x, 0, 0}, {1, 0, 0, 0}}}; }

/// A camera that steps `step` units a frame at 100 Hz.
class BenchParts : public ::testing::Test {
 protected:
  BenchParts() {
    auto renderer = std::make_unique<GreyRenderer>();
    grey_ = renderer.get();
    setup_.made.renderer = std::move(renderer);
    setup_.pool = std::make_shared<ThreadPool>(2);
    setup_.cloud = std::make_shared<const GaussianCloud>();
    setup_.camera = make_camera({}, size_px, 50.0f);
    setup_.fps = 100.0;
    for (int i = 0; i < 23; ++i)
      setup_.poses.push_back(at_x(i * 10'000, 0.001f * static_cast<float>(i)));
    setup_.samples = setup_.poses;
    paper_.pipeline = Pipeline::paper;
  }

  RenderSetup setup_;
  GreyRenderer* grey_ = nullptr;
  ViewSettings paper_;
};

const ProgressReport no_report = [](double) {};

TEST_F(BenchParts, MeasureTellsKeyAndSubFramesApart) {
  const Measurement measurement = measure(setup_, paper_, 1, no_report);
  ASSERT_EQ(measurement.frames.size(), 23u);
  // The first two frames know no motion yet: groups of one; then 4 groups of 5, and the last one is
  // cut by the end of the path, not by the camera.
  EXPECT_EQ(measurement.frame_ms(FrameKind::key).size(), 7u);
  EXPECT_EQ(measurement.frame_ms(FrameKind::sub).size(), 16u);
  EXPECT_EQ(measurement.window_histogram(), (std::map<int, std::size_t>{{0, 2}, {4, 5}}));
  EXPECT_EQ(measurement.windows_cut(), 0u);
  EXPECT_DOUBLE_EQ(measurement.frames_per_key(), 23.0 / 7.0);
  EXPECT_DOUBLE_EQ(measurement.keys_without_window(), 2.0 / 7.0);
  EXPECT_DOUBLE_EQ(measurement.mean_stage_ms(Stage::sort, FrameKind::key), 3.0);
  EXPECT_DOUBLE_EQ(measurement.mean_stage_ms(Stage::sort, FrameKind::sub), 1.0);
  EXPECT_DOUBLE_EQ(measurement.list_length(FrameKind::key).mean, 100.0);
  EXPECT_DOUBLE_EQ(measurement.list_length().mean, (700.0 + 16 * 50.0) / 23);
  EXPECT_EQ(measurement.view_bytes, 77u);
  EXPECT_EQ(grey_->requests.size(), 24u);
}

TEST_F(BenchParts, WindowsThatTheCameraLeavesAreCounted) {
  setup_.poses[9].world_from_camera.position.y = 50.0f;  // in the middle of a group
  const Measurement measurement = measure(setup_, paper_, 0, no_report);
  EXPECT_EQ(measurement.frames[8].stats.kind, FrameKind::sub);
  EXPECT_EQ(measurement.frames[9].stats.kind, FrameKind::key);
  EXPECT_GE(measurement.windows_cut(), 1u);
}

TEST_F(BenchParts, JudgeFindsTheKnownErrors) {
  const QualityReport quality = judge(setup_, paper_, 1, no_report);
  EXPECT_EQ(quality.key.frames(), 7u);
  EXPECT_EQ(quality.sub.frames(), 16u);
  EXPECT_NEAR(quality.key.mean_psnr(), -20.0 * std::log10(key_error), 0.01);
  EXPECT_NEAR(quality.sub.mean_psnr(), -20.0 * std::log10(sub_error), 0.01);
  EXPECT_NEAR(quality.sub.worst_block_psnr(), -20.0 * std::log10(sub_error), 0.01);
  EXPECT_EQ(quality.see_through.count, 23u);
  EXPECT_EQ(quality.see_through.mean(), 1.0);  // transmittance 0.6 everywhere
  // From a sub-frame to a key frame, the picture falls by 0.009 on top of the true step of 0.001
  // upwards. The two steps between key frames add nothing.
  EXPECT_EQ(quality.pop.count, 6u);
  EXPECT_NEAR(quality.pop.max, sub_error - key_error - 2 * 0.001, 1e-5);
  EXPECT_EQ(quality.pops, 4u);
  EXPECT_GT(quality.worst_pop_frame, 0u);  // the first has none before it
}

TEST_F(BenchParts, TheWorstFramesAreKeptAndWritten) {
  paper_.speculation.initial_window = 2;
  const QualityReport quality = judge(setup_, paper_, 1, no_report);
  EXPECT_EQ(quality.worst_sub.frame.number, quality.sub.worst_frame());
  EXPECT_EQ(quality.worst_sub.block.number, quality.sub.worst_block_frame());
  EXPECT_NEAR(quality.worst_sub.frame.judged.rgb[5] - quality.worst_sub.frame.truth.rgb[5],
              sub_error, 1e-6f);
  EXPECT_NEAR(quality.worst_key.block.judged.rgb[5] - quality.worst_key.block.truth.rgb[5],
              key_error, 1e-6f);

  const test::TemporaryFolder folder;
  make_worst_frames_folder(folder / "new/worst");
  write_worst_frames(folder / "new/worst", quality);
  const auto name = fmt::format("new/worst/sub_worst_frame_{:06}", quality.sub.worst_frame());
  EXPECT_EQ(read_png(folder / (name + ".png")).size_px, size_px);
  EXPECT_NEAR(read_png(folder / (name + "_exact.png")).rgb[0], quality.worst_sub.frame.truth.rgb[0],
              0.5f / 255.0f);
  EXPECT_NEAR(read_png(folder / (name + "_difference.png")).rgb[0], 16.0f * sub_error,
              0.5f / 255.0f);
}

TEST_F(BenchParts, PopsAreJudgedInEveryPipeline) {
  const QualityReport quality = judge(setup_, {.pipeline = Pipeline::catgs}, 1, no_report);
  EXPECT_EQ(quality.pop.count, 22u);
  EXPECT_NEAR(quality.pop.max, 0.0, 1e-6);
}

TEST_F(BenchParts, JudgeTakesEveryNthFrameAndStep) {
  const QualityReport quality = judge(setup_, paper_, 3, no_report);
  EXPECT_EQ(quality.key.frames() + quality.sub.frames(), 8u);
  EXPECT_EQ(quality.pop.count, 2u);
}

TEST_F(BenchParts, ForecastsKnowOnlyThePast) {
  // Samples at 25 Hz, frames at 100 Hz between them, as of a trace that is resampled at run time.
  const auto forecasts = [&](float turning_point) {
    setup_.samples.clear();
    for (int i = 0; i < 20; ++i) {
      const float x = 0.004f * static_cast<float>(i);
      setup_.samples.push_back(at_x(i * 40'000, i < 15 ? x : x + turning_point));
    }
    setup_.poses = resample(setup_.samples, 100.0);
    FrameFeed feed(setup_, paper_);
    std::vector<std::optional<Forecast>> all;
    for (std::size_t i = 0; i < setup_.poses.size(); ++i) all.push_back(feed.next().forecast);
    return all;
  };
  const auto straight = forecasts(0.0f), turning = forecasts(0.003f);
  EXPECT_FALSE(straight[7].has_value());  // two samples so far
  for (std::size_t i = 8; i < 60; ++i) {  // sample 15 comes with frame 60
    ASSERT_TRUE(straight[i].has_value()) << i;
    EXPECT_EQ(straight[i]->frames, 4) << i;
    EXPECT_EQ(straight[i]->world_from_camera.position, turning[i]->world_from_camera.position) << i;
    const auto ahead = static_cast<float>(setup_.poses[i].time_us + 40'000);
    // Forecasts have come true often enough after half of these frames.
    EXPECT_NEAR(straight[i]->world_from_camera.position.x, 1e-7f * ahead, i < 30 ? 1e-3f : 2e-5f)
        << i;
  }
  EXPECT_NE(straight[60]->world_from_camera.position, turning[60]->world_from_camera.position);
}

TEST_F(BenchParts, ForecastsAreMadeAsTheSetupSays) {
  // To and fro with every frame: no forecast comes true, and its horizon is halved.
  for (std::size_t i = 0; i < setup_.samples.size(); ++i) {
    setup_.samples[i].world_from_camera.position.x = i % 2 == 0 ? 0.01f : 0.0f;
  }
  paper_.speculation.initial_window = 16;
  const auto last_frames = [&] {
    FrameFeed feed(setup_, paper_);
    std::optional<Forecast> last;
    for (std::size_t i = 0; i < setup_.poses.size(); ++i) last = feed.next().forecast;
    return last ? last->frames : -1;
  };
  EXPECT_EQ(last_frames(), 5);
  setup_.predictor = {.horizon_us = 160'000, .min_confidence = 1.0};
  EXPECT_EQ(last_frames(), 16);
}

TEST_F(BenchParts, OtherPipelinesGetNoForecast) {
  FrameFeed feed(setup_, {});
  for (std::size_t i = 0; i < setup_.poses.size(); ++i) EXPECT_FALSE(feed.next().forecast);
}

}  // namespace
}  // namespace catgs
