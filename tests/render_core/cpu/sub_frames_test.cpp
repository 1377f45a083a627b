// Key frames and sub-frames of the CPU core against its exact pipeline at the same poses.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <gtest/gtest.h>

#include "render_core/cpu/scene_store.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/motion/predictor.h"
#include "render_core/motion/script.h"
#include "render_core/renderer.h"
#include "render_core/scene/synth.h"
#include "render_core/thread_pool.h"
#include "tests/support/camera_moves.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::Move;
using test::moved;
using test::moves;
using test::patient_settings;
using test::request_on_path;
using test::TestScene;
using test::window;

std::shared_ptr<ThreadPool> pool_of(int threads) { return std::make_shared<ThreadPool>(threads); }

struct Rendered {
  std::vector<float> rgb;
  FrameStats stats;
};

Rendered render(View& view, const FrameRequest& request) {
  FrameView frame;
  const RenderStatus status = view.render(request, frame);
  EXPECT_TRUE(status.ok()) << status.message;
  return {test::copy_rgb(frame), frame.stats};
}

class SubFrames : public testing::TestWithParam<TestScene> {
 protected:
  static std::unique_ptr<Renderer> renderer(int threads = 2, const std::string& simd = "auto") {
    return make_renderer(GetParam().cloud, {RendererKind::cpu, pool_of(threads), simd}).renderer;
  }
};

// Nothing may be missing as long as the camera keeps to the forecast, Gaussians that come through
// the near plane or into the image among it. Measured: 151 dB and more in key frames, which round
// differently from `exact`, and as much in sub-frames, but for one of 101 dB, where two depths that
// are equal by one way of rounding are not by the other.
TEST_P(SubFrames, OnTheForecastPathNothingIsMissing) {
  const TestScene& scene = GetParam();
  for (const std::string_view simd : simd_targets()) {
    const auto core = renderer(2, std::string(simd));
    const auto exact = core->make_view({});
    for (const Move& move : moves()) {
      SCOPED_TRACE(std::string(simd) + " " + move.name);
      const auto view = core->make_view(patient_settings());
      for (int k = 0; k <= window; ++k) {
        const FrameRequest request = request_on_path(scene, move, k);
        const Rendered drawn = render(*view, request), expected = render(*exact, request);
        EXPECT_EQ(drawn.stats.kind, k == 0 ? FrameKind::key : FrameKind::sub) << k;
        EXPECT_EQ(drawn.stats.window, window);
        EXPECT_EQ(drawn.stats.overflowed_entries, 0u);
        EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), k == 0 ? 120.0 : 90.0) << "frame " << k;
      }
      EXPECT_EQ(render(*view, request_on_path(scene, move, window)).stats.kind, FrameKind::key);
    }
  }
}

TEST_P(SubFrames, ThreadsDoNotChangeTheImage) {
  const Move move = moves().back();
  const auto one = renderer(1), many = renderer(5);
  const auto one_view = one->make_view(patient_settings());
  const auto many_view = many->make_view(patient_settings());
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(GetParam(), move, k);
    EXPECT_EQ(render(*one_view, request).rgb, render(*many_view, request).rgb);
  }
}

TEST_P(SubFrames, AStillCameraNeedsNoFreshOrder) {
  ViewSettings settings = patient_settings();
  settings.order = BlendOrder::key;
  const auto core = renderer();
  const auto view = core->make_view(settings), exact = core->make_view({});
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(GetParam(), {}, k);
    EXPECT_GE(test::psnr_db(render(*view, request).rgb, render(*exact, request).rgb), 120.0) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(, SubFrames, testing::ValuesIn(test::small_scenes()),
                         [](const auto& test) { return test.param.name; });

// Gaussians are culled in clusters of neighbours. Here one cluster fills the view and another comes
// in whole, from the side or through the near plane.
TEST(CatgsView, ClustersThatComeIntoViewAreKept) {
  struct Entrance {
    glm::vec3 centre;  // of the cluster that comes in
    Move move;
  };
  const Entrance entrances[] = {{{4.1f, 0, 6.2f}, {"yaw", {0, 0, 0}, {0, 0.2f, 0}}},
                                {{0, 0, -0.05f}, {"back", {0, 0, -0.4f}, {0, 0, 0}}}};
  for (const Entrance& entrance : entrances) {
    SCOPED_TRACE(entrance.move.name);
    GaussianCloud cloud = test::random_cloud(2 * cluster_size, 0, 9);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const glm::vec3 offset = 0.1f * (cloud.mean[i] - glm::vec3(0, 0, 5));
      cloud.mean[i] = offset + (i < cluster_size ? glm::vec3(0, 0, 5) : entrance.centre);
      cloud.scale[i] *= i < cluster_size ? 1.0f : 0.1f;
    }
    TestScene scene;
    scene.cloud = std::make_shared<const GaussianCloud>(std::move(cloud));
    scene.request.camera = make_camera({}, {160, 120}, 150.0f);
    const auto renderer =
        make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
    const auto view = renderer->make_view(patient_settings()), exact = renderer->make_view({});
    std::uint32_t visible_first = 0, visible_last = 0;
    for (int k = 0; k <= window; ++k) {
      const FrameRequest request = request_on_path(scene, entrance.move, k);
      const Rendered drawn = render(*view, request), expected = render(*exact, request);
      EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), 80.0) << "frame " << k;
      (k == 0 ? visible_first : visible_last) = expected.stats.visible;
    }
    EXPECT_LE(visible_first, cluster_size);
    EXPECT_GT(visible_last, cluster_size + cluster_size / 2);
  }
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

// Forecasts from past samples are never quite right; the lists then miss rims of Gaussians at the
// edges of tiles. Measured over `head`, which is the worst: 88 dB, 77 dB the worst frame.
TEST(CatgsView, KeepsItsQualityOnScriptedMotion) {
  const auto pool = pool_of(2);
  const Scene scene = synthesize(SynthKind::city, 20'000, 1, *pool);
  const auto cloud = std::make_shared<const GaussianCloud>(scene.cloud);
  const auto renderer = make_renderer(cloud, {RendererKind::cpu, pool, "auto"}).renderer;
  for (const std::string script : {"walk", "head", "drone"}) {
    const auto view = renderer->make_view({.pipeline = Pipeline::catgs});
    const auto exact = renderer->make_view({});
    MotionPredictor predictor;
    MeanPsnr keys, subs;
    for (const TimedPose& sample :
         make_script({.script = script, .duration_s = 0.6}, scene.hints)) {
      predictor.add(sample);
      FrameRequest request;
      request.camera = make_camera(sample.world_from_camera, {320, 192}, 183.0f);
      request.forecast = predictor.forecast(sample.time_us, 120.0, window);
      const Rendered drawn = render(*view, request), expected = render(*exact, request);
      (drawn.stats.kind == FrameKind::key ? keys : subs)
          .add(test::psnr_db(drawn.rgb, expected.rgb));
    }
    SCOPED_TRACE(script);
    EXPECT_GE(subs.count(), 40);
    // A Gaussian that is at 1/255 in a pixel is drawn there or not by a last bit: 106 dB measured;
    // without such a pixel 147 dB.
    EXPECT_GE(keys.worst(), 100.0);
    EXPECT_GE(subs.mean(), 75.0);
    EXPECT_GE(subs.worst(), 60.0);
  }
}

TEST(CatgsView, KeyOrderIsWrongOnceTheViewTurned) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer =
      make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
  ViewSettings settings = patient_settings();
  settings.order = BlendOrder::key;
  const auto view = renderer->make_view(settings), exact = renderer->make_view({});
  const Move yaw{"yaw", {0, 0, 0}, {0, 0.05f, 0}};
  double psnr = 0.0;
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(scene, yaw, k);
    psnr = test::psnr_db(render(*view, request).rgb, render(*exact, request).rgb);
  }
  // 2.9 degrees; 46.5 dB measured.
  EXPECT_GT(psnr, 42.0);
  EXPECT_LT(psnr, 60.0);
}

TEST(CatgsView, WithoutForecastIsTheExactPipeline) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer =
      make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
  const auto view = renderer->make_view({.pipeline = Pipeline::catgs});
  const auto exact = renderer->make_view({});
  for (int k = 0; k < 3; ++k) {
    const Rendered drawn = render(*view, scene.request), expected = render(*exact, scene.request);
    EXPECT_EQ(drawn.rgb, expected.rgb);
    EXPECT_EQ(drawn.stats.kind, FrameKind::key);
    EXPECT_EQ(drawn.stats.window, 0);
    EXPECT_EQ(drawn.stats.list_entries, expected.stats.list_entries);
  }
}

TEST(CatgsView, ANewImageSizeIsANewGroup) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer =
      make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
  const auto view = renderer->make_view(patient_settings());
  const auto exact = renderer->make_view({});
  FrameRequest request = request_on_path(scene, moves().front(), 0);
  render(*view, request);
  for (const glm::ivec2 size : {glm::ivec2(200, 150), glm::ivec2(17, 300), glm::ivec2(64, 64)}) {
    request.camera = make_camera(request.camera.world_from_camera, size, 140.0f);
    const Rendered key = render(*view, request), sub = render(*view, request);
    EXPECT_EQ(key.stats.kind, FrameKind::key);
    EXPECT_EQ(sub.stats.kind, FrameKind::sub);
    EXPECT_GE(test::psnr_db(sub.rgb, render(*exact, request).rgb), 120.0);
  }
}

TEST(CatgsView, ListMemoryIsBoundedInKeyAndSubFrames) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer =
      make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
  ViewSettings settings = patient_settings();
  settings.max_list_entries = 1000;
  const auto view = renderer->make_view(settings);
  for (int k = 0; k <= window; ++k) {
    const FrameStats stats = render(*view, request_on_path(scene, moves().back(), k)).stats;
    EXPECT_LE(stats.list_entries, 1000u);
    EXPECT_GT(stats.overflowed_entries, 0u);
  }
}

TEST(CatgsView, CountsWhatItMeasures) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer =
      make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
  const auto view = renderer->make_view(patient_settings());
  const Move sideways{"sideways", {0.1f, 0, 0}, {0, 0, 0}};
  const FrameStats key = render(*view, request_on_path(scene, sideways, 0)).stats;
  // A sideways step moves a point by f step / z; the nearest the most.
  EXPECT_GT(key.nearest_depth, 2.0f);
  EXPECT_NEAR(key.displacement_px, 150.0f * 0.1f / key.nearest_depth, 1e-3f);
  const FrameStats sub = render(*view, request_on_path(scene, sideways, 1)).stats;
  EXPECT_FLOAT_EQ(sub.nearest_depth, key.nearest_depth);
  EXPECT_EQ(sub.list_entries, key.list_entries);
  EXPECT_GT(view->memory_bytes(), 160u * 120 * 12);
}

}  // namespace
}  // namespace catgs
