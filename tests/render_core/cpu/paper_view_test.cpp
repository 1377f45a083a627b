// Pipeline::paper in the CPU core against its exact pipeline at the same poses.

#include <ranges>
#include <string>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/kernels.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/frame/renderer.h"
#include "render_core/motion/frame_groups.h"
#include "tests/support/camera_moves.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::Move;
using test::moved;
using test::moves;
using test::patient_settings;
using test::render_in;
using test::Rendered;
using test::request_on_path;
using test::TestScene;
using test::window;

std::shared_ptr<ThreadPool> pool_of(int threads) { return std::make_shared<ThreadPool>(threads); }

class PaperViews : public testing::TestWithParam<TestScene> {
 protected:
  static std::unique_ptr<Renderer> renderer(int threads = 2, const std::string& simd = "auto") {
    return make_renderer(GetParam().cloud, {RendererKind::cpu, pool_of(threads), simd}).renderer;
  }
};

// Nothing may be missing as long as the camera keeps to the forecast, Gaussians that come through
// the near plane or into the image among it. Order is another matter: a turn makes it wrong.
TEST_P(PaperViews, OnTheForecastPathNothingIsMissing) {
  const TestScene& scene = GetParam();
  for (const std::string_view simd : std::views::transform(simd_kernels(), &SimdKernels::name)) {
    const auto core = renderer(2, std::string(simd));
    const auto exact = core->make_view({});
    for (const Move& move : moves()) {
      SCOPED_TRACE(std::string(simd) + " " + move.name);
      ViewSettings settings = patient_settings();
      settings.colour_cache = false;
      const auto view = core->make_view(settings);
      const bool ordered = move.turn_rad == glm::vec3(0.0f);
      for (int k = 0; k <= window; ++k) {
        const FrameRequest request = request_on_path(scene, move, k);
        const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
        EXPECT_EQ(drawn.stats.kind, k == 0 ? FrameKind::key : FrameKind::sub) << k;
        EXPECT_EQ(drawn.stats.window, window);
        EXPECT_EQ(drawn.stats.overflowed_entries, 0u);
        const double bound = k == 0 ? 120.0 : ordered ? 60.0 : 15.0;
        EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), bound) << "frame " << k;
      }
      EXPECT_EQ(render_in(*view, request_on_path(scene, move, window)).stats.kind, FrameKind::key);
    }
  }
}

TEST_P(PaperViews, ThreadsDoNotChangeTheImage) {
  const Move move = moves().back();
  const auto one = renderer(1), many = renderer(5);
  const auto one_view = one->make_view(patient_settings());
  const auto many_view = many->make_view(patient_settings());
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(GetParam(), move, k);
    EXPECT_EQ(render_in(*one_view, request).rgb, render_in(*many_view, request).rgb);
  }
}

TEST_P(PaperViews, AStillCameraSeesTheExactPicture) {
  const auto core = renderer();
  const auto view = core->make_view(patient_settings()), exact = core->make_view({});
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(GetParam(), {}, k);
    EXPECT_GE(test::psnr_db(render_in(*view, request).rgb, render_in(*exact, request).rgb), 120.0)
        << k;
  }
}

INSTANTIATE_TEST_SUITE_P(, PaperViews, testing::ValuesIn(test::small_scenes()),
                         [](const auto& test) { return test.param.name; });

// Gaussians are culled in clusters of neighbours. Here one cluster fills the view and another comes
// in whole, from the side or through the near plane.
TEST(PaperView, ClustersThatComeIntoViewAreKept) {
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
      const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
      // Not more, because the Gaussians are blended in the key frame's order.
      EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), 30.0) << "frame " << k;
      (k == 0 ? visible_first : visible_last) = expected.stats.visible;
    }
    EXPECT_LE(visible_first, cluster_size);
    EXPECT_GT(visible_last, cluster_size + cluster_size / 2);
  }
}

std::unique_ptr<Renderer> cpu_renderer_of(const TestScene& scene) {
  return make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
}

TEST(PaperView, KeyOrderIsWrongOnceTheViewTurned) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer = cpu_renderer_of(scene);
  const auto view = renderer->make_view(patient_settings()), exact = renderer->make_view({});
  const Move yaw{"yaw", {0, 0, 0}, {0, 0.05f, 0}};
  double psnr = 0.0;
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(scene, yaw, k);
    psnr = test::psnr_db(render_in(*view, request).rgb, render_in(*exact, request).rgb);
  }
  // 2.9 degrees; 46.5 dB measured.
  EXPECT_GT(psnr, 42.0);
  EXPECT_LT(psnr, 60.0);
}

TEST(PaperView, NoForecastGivesTheExactPipeline) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer = cpu_renderer_of(scene);
  const auto view = renderer->make_view({.pipeline = Pipeline::paper});
  const auto exact = renderer->make_view({});
  for (int k = 0; k < 3; ++k) {
    const Rendered drawn = render_in(*view, scene.request),
                   expected = render_in(*exact, scene.request);
    EXPECT_EQ(drawn.rgb, expected.rgb);
    EXPECT_EQ(drawn.stats.kind, FrameKind::key);
    EXPECT_EQ(drawn.stats.window, 0);
    EXPECT_EQ(drawn.stats.list_entries, expected.stats.list_entries);
  }
}

TEST(PaperView, ANewImageSizeIsANewGroup) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer = cpu_renderer_of(scene);
  const auto view = renderer->make_view(patient_settings());
  const auto exact = renderer->make_view({});
  FrameRequest request = request_on_path(scene, moves().front(), 0);
  render_in(*view, request);
  for (const glm::ivec2 size : {glm::ivec2(200, 150), glm::ivec2(17, 300), glm::ivec2(64, 64)}) {
    request.camera = make_camera(request.camera.world_from_camera, size, 140.0f);
    const Rendered key = render_in(*view, request), sub = render_in(*view, request);
    EXPECT_EQ(key.stats.kind, FrameKind::key);
    EXPECT_EQ(sub.stats.kind, FrameKind::sub);
    EXPECT_GE(test::psnr_db(sub.rgb, render_in(*exact, request).rgb), 120.0);
  }
}

TEST(PaperView, ListMemoryIsBoundedInKeyAndSubFrames) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer = cpu_renderer_of(scene);
  ViewSettings settings = patient_settings();
  settings.max_list_entries = 1000;
  const auto view = renderer->make_view(settings);
  for (int k = 0; k <= window; ++k) {
    const FrameStats stats = render_in(*view, request_on_path(scene, moves().back(), k)).stats;
    EXPECT_LE(stats.list_entries, 1000u);
    EXPECT_GT(stats.overflowed_entries, 0u);
  }
}

TEST(PaperView, CountsWhatItMeasures) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer = cpu_renderer_of(scene);
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

}  // namespace
}  // namespace catgs
