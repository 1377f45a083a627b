#pragma once

// What every core's key frames and sub-frames must do. Included by one test file of each core,
// which says which core by INSTANTIATE_TEST_SUITE_P.

#include <algorithm>
#include <cmath>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/motion/predictor.h"
#include "render_core/motion/script.h"
#include "render_core/renderer.h"
#include "render_core/synth/synth.h"
#include "tests/support/camera_moves.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {

struct Core {
  RendererKind kind;
  double exact_db;   // between frames that differ by rounding alone
  double repeat_db;  // between frames that were made in the same way
};
inline void PrintTo(const Core& core, std::ostream* out) {
  *out << (core.kind == RendererKind::cuda ? "cuda" : "cpu");
}

class CatgsView : public testing::TestWithParam<Core> {
 protected:
  void SetUp() override {
    const std::string obstacle = GetParam().kind == RendererKind::cuda ? cuda_obstacle() : "";
    if (!obstacle.empty()) GTEST_SKIP() << obstacle;
  }

  static std::unique_ptr<Renderer> renderer_of(std::shared_ptr<const GaussianCloud> cloud) {
    return make_renderer(std::move(cloud),
                         {.kind = GetParam().kind, .pool = std::make_shared<ThreadPool>(2)})
        .renderer;
  }
};

/// `count` small faint Gaussians before each other, 2 to 6 units around the origin and within 0.7
/// rad of what looks along z.
inline GaussianCloud layers(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](float low, float high) {
    return low + (high - low) * static_cast<float>(random() >> 40) * 0x1p-24f;
  };
  GaussianCloud cloud;
  cloud.resize(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const float distance = uniform(2.0f, 6.0f), angle = uniform(-0.7f, 0.7f);
    const glm::vec3 direction(std::sin(angle), uniform(-0.25f, 0.25f), std::cos(angle));
    cloud.mean[i] = distance * direction;
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.scale[i] = glm::vec3(0.012f * distance);
    cloud.opacity[i] = 0.02f;
    cloud.sh[i] = glm::vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  }
  return cloud;
}

/// PSNR of mean squared errors, dB.
class MeanPsnr {
 public:
  void add(double psnr_db) {
    sum_ += std::pow(10.0, -0.1 * psnr_db);
    ++count_;
    worst_ = std::min(worst_, psnr_db);
  }
  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] double mean() const { return -10.0 * std::log10(sum_ / count_); }
  [[nodiscard]] double worst() const { return worst_; }

 private:
  double sum_ = 0.0, worst_ = INFINITY;
  int count_ = 0;
};

// Forecasts from past samples are never quite right; lists hold for all cameras of the guard set.
// Measured on the CPU over `drone`, which is the worst: 123 dB, 106 dB the worst frame.
TEST_P(CatgsView, KeepsItsQualityOnScriptedMotion) {
  ThreadPool pool(2);
  const Scene scene = synthesize(SynthKind::city, 20'000, 1, pool);
  const auto renderer = renderer_of(std::make_shared<const GaussianCloud>(scene.cloud));
  for (const std::string script : {"walk", "head", "drone"}) {
    const auto view = renderer->make_view({.pipeline = Pipeline::catgs, .colour_cache = false});
    const auto exact = renderer->make_view({});
    MotionPredictor predictor;
    MeanPsnr keys, subs;
    for (const TimedPose& sample :
         make_script({.script = script, .duration_s = 0.6}, scene.hints)) {
      predictor.add(sample);
      FrameRequest request;
      request.camera = make_camera(sample.world_from_camera, {320, 192}, 183.0f);
      request.forecast = predictor.forecast(sample.time_us, 120.0, window);
      const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
      (drawn.stats.kind == FrameKind::key ? keys : subs).add(psnr_db(drawn.rgb, expected.rgb));
    }
    SCOPED_TRACE(script);
    EXPECT_GE(subs.count(), 40);
    // A Gaussian that is at 1/255 in a pixel is drawn there or not by a last bit: 106 dB measured
    // on the CPU; without such a pixel 147 dB.
    EXPECT_GE(keys.worst(), std::min(100.0, GetParam().exact_db));
    EXPECT_GE(subs.mean(), 75.0);
    EXPECT_GE(subs.worst(), 60.0);
  }
}

TEST_P(CatgsView, KeyOrderIsWrongOnceTheViewTurned) {
  const TestScene scene = small_scenes().front();
  const auto renderer = renderer_of(scene.cloud);
  ViewSettings settings = patient_settings();
  settings.order = BlendOrder::key;
  const auto view = renderer->make_view(settings), exact = renderer->make_view({});
  const Move yaw{"yaw", {0, 0, 0}, {0, 0.05f, 0}};
  double psnr = 0.0;
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(scene, yaw, k);
    psnr = psnr_db(render_in(*view, request).rgb, render_in(*exact, request).rgb);
  }
  // 2.9 degrees; 46.5 dB measured.
  EXPECT_GT(psnr, 42.0);
  EXPECT_LT(psnr, 60.0);
}

TEST_P(CatgsView, WithoutForecastIsTheExactPipeline) {
  const TestScene scene = small_scenes().front();
  const auto renderer = renderer_of(scene.cloud);
  const auto view = renderer->make_view({.pipeline = Pipeline::catgs});
  const auto exact = renderer->make_view({});
  for (int k = 0; k < 3; ++k) {
    const Rendered drawn = render_in(*view, scene.request),
                   expected = render_in(*exact, scene.request);
    EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), GetParam().repeat_db);
    EXPECT_EQ(drawn.stats.kind, FrameKind::key);
    EXPECT_EQ(drawn.stats.window, 0);
    EXPECT_EQ(drawn.stats.list_entries, expected.stats.list_entries);
  }
}

// Beside the camera and behind its near plane, until a turn that nobody forecast brings it before
// that plane: then its footprint covers the picture.
TEST_P(CatgsView, AGiantThatATurnBringsInIsDrawn) {
  const GaussianCloud without = random_cloud(300, 0, 5);
  GaussianCloud with = without;
  with.resize(without.size() + 1, 0);
  with.mean.back() = {60.0f, 0.0f, -0.05f};
  with.rotation.back() = glm::quat(1, 0, 0, 0);
  with.scale.back() = glm::vec3(25.0f);
  with.opacity.back() = 0.5f;
  with.sh.back() = glm::vec3(1.0f);
  const auto renderer = renderer_of(std::make_shared<const GaussianCloud>(with));
  const auto view = renderer->make_view({.pipeline = Pipeline::catgs});
  const auto exact = renderer->make_view({});
  const auto lacking = renderer_of(std::make_shared<const GaussianCloud>(without));
  const auto lacking_view = lacking->make_view({.pipeline = Pipeline::catgs});
  FrameRequest request;
  request.camera = make_camera({}, {160, 120}, 150.0f);
  request.camera.near_z = 0.2f;
  request.forecast = Forecast{Pose{}, 4};
  EXPECT_EQ(render_in(*view, request).stats.window, 4);
  EXPECT_EQ(render_in(*lacking_view, request).stats.window, 4);
  request.camera.world_from_camera.orientation = glm::quat(glm::vec3(0.0f, 0.0052f, 0.0f));
  const Rendered expected = render_in(*exact, request), drawn = render_in(*view, request);
  EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), GetParam().exact_db);
  // The turn is one that lists hold for: what draws this again, if anything, is the giant.
  const Rendered lacks = render_in(*lacking_view, request);
  EXPECT_EQ(lacks.stats.kind, FrameKind::sub);
  EXPECT_LT(psnr_db(lacks.rgb, expected.rgb), 40.0);
  const bool watches = GetParam().kind == RendererKind::cuda;
  EXPECT_EQ(drawn.stats.kind, watches ? FrameKind::key : FrameKind::sub);
}

// Two Gaussians far to the sides that reach all over the picture: a turn brings one before most of
// the others and one behind, thousands of list entries away; then the camera turns back. Left where
// they stood: 57 dB, and 70 dB after the way back.
TEST_P(CatgsView, GiantsAreDrawnWhereATurnPutsThem) {
  GaussianCloud cloud = layers(60'000, 3);
  for (const float side : {-1.0f, 1.0f}) {
    cloud.resize(cloud.size() + 1, 0);
    cloud.mean.back() = {60.0f * side, 0.0f, 4.0f + 1.3f * side};
    cloud.rotation.back() = glm::quat(1, 0, 0, 0);
    cloud.scale.back() = {40.0f, 40.0f, 0.1f};
    cloud.opacity.back() = 0.7f;
    cloud.sh.back() = glm::vec3(side);
  }
  TestScene scene{"giants", std::make_shared<const GaussianCloud>(std::move(cloud)), {}};
  scene.request.camera = make_camera({}, {160, 64}, 150.0f);
  const auto renderer = renderer_of(scene.cloud);
  const auto view = renderer->make_view(patient_settings()), exact = renderer->make_view({});
  const Move yaw{"yaw", {0, 0, 0}, {0, 0.04f, 0}};
  FrameKind kind = FrameKind::key;
  for (const int k : {0, window, 0}) {
    SCOPED_TRACE(k);
    const FrameRequest request = request_on_path(scene, yaw, k);
    const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
    EXPECT_EQ(drawn.stats.kind, std::exchange(kind, FrameKind::sub));
    EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 75.0);
  }
}

// Strong harmonics, seen by a camera that turns, steps aside and comes back: colours are kept, but
// none for too long. The two Views differ in nothing else. Measured: 72 dB and more.
TEST_P(CatgsView, ColoursAreKeptWhileTheirDirectionHolds) {
  const TestScene scene = small_scenes().front();
  const auto renderer = renderer_of(scene.cloud);
  for (const bool speculates : {false, true}) {
    SCOPED_TRACE(speculates);
    ViewSettings settings = patient_settings();
    const auto keeping = renderer->make_view(settings);
    settings.colour_cache = false;
    const auto shading = renderer->make_view(settings);
    FrameRequest request = scene.request;
    Pose& pose = request.camera.world_from_camera;
    const auto psnr = [&] {
      if (speculates) request.forecast = Forecast{pose, 10};
      const Rendered kept = render_in(*keeping, request), shaded = render_in(*shading, request);
      EXPECT_EQ(kept.stats.kind, shaded.stats.kind);
      return psnr_db(kept.rgb, shaded.rgb);
    };
    EXPECT_GE(psnr(), 100.0);
    pose.orientation = glm::quat(glm::vec3(0.1f, -0.2f, 0.3f)) * pose.orientation;
    EXPECT_GE(psnr(), 100.0) << "turning changes no colour";
    int kept = 0;
    for (int step = 0; step < 30; ++step) {
      pose.position.x += step < 20 ? 0.004f : -0.006f;
      const double db = psnr();
      EXPECT_GE(db, 60.0) << "step " << step;
      kept += db < 100.0;
    }
    EXPECT_GT(kept, 0);
  }
}

TEST_P(CatgsView, ANewImageSizeIsANewGroup) {
  const TestScene scene = small_scenes().front();
  const auto renderer = renderer_of(scene.cloud);
  const auto view = renderer->make_view(patient_settings());
  const auto exact = renderer->make_view({});
  FrameRequest request = request_on_path(scene, moves().front(), 0);
  render_in(*view, request);
  for (const glm::ivec2 size : {glm::ivec2(200, 150), glm::ivec2(17, 300), glm::ivec2(64, 64)}) {
    request.camera = make_camera(request.camera.world_from_camera, size, 140.0f);
    const Rendered key = render_in(*view, request), sub = render_in(*view, request);
    EXPECT_EQ(key.stats.kind, FrameKind::key);
    EXPECT_EQ(sub.stats.kind, FrameKind::sub);
    EXPECT_GE(psnr_db(sub.rgb, render_in(*exact, request).rgb), GetParam().exact_db);
  }
}

TEST_P(CatgsView, ListMemoryIsBoundedInKeyAndSubFrames) {
  const TestScene scene = small_scenes().front();
  const auto renderer = renderer_of(scene.cloud);
  ViewSettings settings = patient_settings();
  settings.max_list_entries = 1000;
  const auto view = renderer->make_view(settings);
  for (int k = 0; k <= window; ++k) {
    const FrameStats stats = render_in(*view, request_on_path(scene, moves().back(), k)).stats;
    EXPECT_LE(stats.list_entries, 1000u);
    EXPECT_GT(stats.overflowed_entries, 0u);
  }
}

TEST_P(CatgsView, CountsWhatItMeasures) {
  const TestScene scene = small_scenes().front();
  const auto renderer = renderer_of(scene.cloud);
  const auto view = renderer->make_view(patient_settings());
  const Move sideways{"sideways", {0.1f, 0, 0}, {0, 0, 0}};
  const FrameStats key = render_in(*view, request_on_path(scene, sideways, 0)).stats;
  // A sideways step moves a point by f step / z; the nearest the most.
  EXPECT_GT(key.nearest_depth, 2.0f);
  EXPECT_NEAR(key.displacement_px, 150.0f * 0.1f / key.nearest_depth, 1e-3f);
  const FrameStats sub = render_in(*view, request_on_path(scene, sideways, 1)).stats;
  EXPECT_FLOAT_EQ(sub.nearest_depth, key.nearest_depth);
  EXPECT_EQ(sub.list_entries, key.list_entries);
  EXPECT_GT(view->memory_bytes(), 160u * 120 * 12);
}

}  // namespace catgs::test
