// Whole images of the CUDA core against the reference and the CPU core; needs a device.

#include "render_core/cuda/cuda_renderer.h"

#include <algorithm>
#include <numeric>
#include <thread>

#include <gtest/gtest.h>

#include "tests/render_core/cores/tree_views.h"
#include "tests/render_core/cuda/device.h"
#include "tests/support/camera_moves.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::random_scene;
using test::render;
using test::render_in;
using test::Rendered;
using test::renderer_of;
using test::TestScene;

class CudaSmallScenes : public test::CoreTest, public testing::WithParamInterface<TestScene> {};
using CudaRenderer = test::CoreTest;

TEST_P(CudaSmallScenes, MatchesReference) {
  const TestScene& scene = GetParam();
  const auto reference = render(*renderer_of(scene, RendererKind::reference), scene.request);
  const auto cuda = render(*renderer_of(scene, RendererKind::cuda), scene.request);
  EXPECT_GE(test::psnr_db(cuda.rgb, reference.rgb), 60.0);
  EXPECT_EQ(cuda.stats.overflowed_entries, 0u);
}

// Nothing may be missing as long as the camera keeps to the forecast, Gaussians that come through
// the near plane or into the image among it. Order is another matter: sub-frames blend in the order
// of their key frame, which a turn makes wrong.
TEST_P(CudaSmallScenes, SubFramesOnTheForecastPathMissNothing) {
  const TestScene& scene = GetParam();
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto exact = renderer->make_view({});
  for (const test::Move& move : test::moves()) {
    SCOPED_TRACE(move.name);
    const auto view = renderer->make_view(test::patient_settings());
    for (int k = 0; k <= test::window; ++k) {
      const FrameRequest request = test::request_on_path(scene, move, k);
      const Rendered drawn = render_in(*view, request);
      EXPECT_EQ(drawn.stats.kind, k == 0 ? FrameKind::key : FrameKind::sub) << k;
      EXPECT_EQ(drawn.stats.window, test::window);
      const bool ordered = move.turn_rad == glm::vec3(0.0f);
      const double bound = k == 0 || ordered ? 60.0 : 20.0;
      EXPECT_GE(test::psnr_db(drawn.rgb, render_in(*exact, request).rgb), bound) << "frame " << k;
    }
    EXPECT_EQ(render_in(*view, test::request_on_path(scene, move, test::window)).stats.kind,
              FrameKind::key);
  }
}

TEST_P(CudaSmallScenes, KeyFramesMeasureWhatTheCpuCoresDo) {
  const TestScene& scene = GetParam();
  for (const test::Move& move : test::moves()) {
    const FrameRequest request = test::request_on_path(scene, move, 0);
    const auto cuda = renderer_of(scene, RendererKind::cuda)->make_view(test::patient_settings());
    const auto cpu = renderer_of(scene, RendererKind::cpu)->make_view(test::patient_settings());
    const FrameStats a = render_in(*cuda, request).stats, b = render_in(*cpu, request).stats;
    // Each core has its own slack at the edge of the image, and the longest path may be there.
    EXPECT_NEAR(a.displacement_px, b.displacement_px, 0.01f + 0.2f * b.displacement_px);
    EXPECT_NEAR(1.0f / a.nearest_depth, 1.0f / b.nearest_depth, 0.02f / b.nearest_depth);
  }
}

// The camera leaps once.
TEST_P(CudaSmallScenes, CatgsStaysCloseToExactWhereverTheCameraGoes) {
  const TestScene& scene = GetParam();
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto exact = renderer->make_view({});
  for (const test::Move& move : test::moves()) {
    SCOPED_TRACE(move.name);
    const auto view = renderer->make_view({.pipeline = Pipeline::catgs});
    FrameRequest request = scene.request;
    for (int k = 0; k < 8; ++k) {
      Pose& pose = request.camera.world_from_camera;
      pose = test::moved(pose, move);
      if (k == 5) pose.position += glm::vec3(1.0f, -0.5f, 0.7f);
      const Rendered drawn = render_in(*view, request);
      EXPECT_EQ(drawn.stats.kind, FrameKind::key);
      EXPECT_GE(test::psnr_db(drawn.rgb, render_in(*exact, request).rgb), 45.0) << k;
    }
  }
}

// Slices are folded as the paper has it; the picture is the unsplit one's.
TEST_P(CudaSmallScenes, SplittingChangesNothing) {
  const TestScene& scene = GetParam();
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto split = renderer->make_view({}), whole = renderer->make_view({.split_tasks = false});
  for (int frame = 0; frame < 3; ++frame) {  // later ones cut where earlier ones ended
    const Rendered a = render_in(*split, scene.request), b = render_in(*whole, scene.request);
    EXPECT_GE(test::psnr_db(a.rgb, b.rgb), 60.0);
    EXPECT_GE(a.stats.tasks, b.stats.tasks);
    for (std::size_t i = 0; i < a.rgb.size(); ++i) ASSERT_NEAR(a.rgb[i], b.rgb[i], 0.25f / 255.0f);
  }
}

TEST_P(CudaSmallScenes, VanillaIsTheCpuCores) {
  const TestScene& scene = GetParam();
  const ViewSettings vanilla{.pipeline = Pipeline::vanilla};
  const auto cuda = render(*renderer_of(scene, RendererKind::cuda), scene.request, vanilla);
  const auto cpu = render(*renderer_of(scene, RendererKind::cpu), scene.request, vanilla);
  EXPECT_GE(test::psnr_db(cuda.rgb, cpu.rgb), 55.0);
  EXPECT_NEAR(static_cast<double>(cuda.stats.list_entries),
              static_cast<double>(cpu.stats.list_entries),
              2.0 + 1e-3 * static_cast<double>(cpu.stats.list_entries));
}

INSTANTIATE_TEST_SUITE_P(, CudaSmallScenes, testing::ValuesIn(test::small_scenes()),
                         [](const auto& test) { return test.param.name; });

TEST_F(CudaRenderer, AGaussianTakesAtMost80BytesOfTheDevice) {
  const TestScene scene = random_scene(50'000);
  EXPECT_LE(renderer_of(scene, RendererKind::cuda)->scene_bytes(), 80u * 50'000u);
}

// Clusters out of sight, or in sight at one end of the window only, cost no Gaussian that is seen.
TEST_F(CudaRenderer, FindsWhatIsVisibleFromAnywhereInTheScene) {
  const TestScene scene = random_scene(100'000);
  const auto cuda = renderer_of(scene, RendererKind::cuda);
  const auto cpu = renderer_of(scene, RendererKind::cpu);
  for (const glm::vec3 target : {glm::vec3(5, 0, 5), glm::vec3(-5, 1, 4), glm::vec3(0, 5, 5.1f)}) {
    FrameRequest request = scene.request;
    request.camera =
        make_camera(test::look_at({0, 0, 5}, target, {0, 0.6f, -0.8f}), {320, 200}, 300);
    const auto a = render(*cuda, request), b = render(*cpu, request);
    EXPECT_GE(test::psnr_db(a.rgb, b.rgb), 57.0);  // 58.8: packed opacities have 12 bits
    EXPECT_NEAR(a.stats.visible, b.stats.visible, 0.02 * b.stats.visible);  // at the edges
    EXPECT_GT(a.stats.visible, 1000u);
    EXPECT_LT(a.stats.visible, 50'000u);
  }
}

TEST_F(CudaRenderer, RepeatsItselfToTheBit) {
  const TestScene scene = random_scene(50'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  EXPECT_EQ(render(*renderer, scene.request).rgb, render(*renderer, scene.request).rgb);
}

TEST_F(CudaRenderer, ViewsRenderSideBySide) {
  const TestScene scene = random_scene(50'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto alone = render(*renderer, scene.request);
  std::vector<std::jthread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 10; ++i) EXPECT_EQ(render(*renderer, scene.request).rgb, alone.rgb);
    });
  }
}

TEST_F(CudaRenderer, OneViewFollowsSizesThatChange) {
  const TestScene scene = random_scene(20'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto view = renderer->make_view({});
  for (const glm::ivec2 size : {glm::ivec2(64, 48), glm::ivec2(1920, 1080), glm::ivec2(33, 17)}) {
    FrameRequest request = scene.request;
    request.camera = make_camera(Pose{}, size, 0.6f * static_cast<float>(size.x));
    FrameView frame;
    ASSERT_TRUE(view->render(request, frame).ok());
    // Not to the bit: where a view cuts long lists depends on what its last frame needed of them.
    EXPECT_GE(test::psnr_db(test::copy_rgb(frame), render(*renderer, request).rgb), 60.0);
  }
}

TEST_F(CudaRenderer, CountsThePairsOfTheCpuCoreAndThoseOfAPixelsLastRound) {
  const TestScene scene = random_scene(20'000);
  // A slice blends some of what an unsplit tile's earlier entries hide.
  const ViewSettings counting{.count_pairs = true, .split_tasks = false};
  const auto cuda = render(*renderer_of(scene, RendererKind::cuda), scene.request, counting);
  const auto cpu = render(*renderer_of(scene, RendererKind::cpu), scene.request, counting);
  const auto pairs = static_cast<double>(cpu.stats.blended_pairs);
  EXPECT_GT(pairs, 0.0);
  EXPECT_GE(static_cast<double>(cuda.stats.blended_pairs), pairs * (1.0 - 1e-3));
  EXPECT_LE(static_cast<double>(cuda.stats.blended_pairs), pairs * 1.3);
}

TEST_F(CudaRenderer, VideoFormatIsTheCpuCores) {
  const TestScene scene = random_scene(20'000);
  const ViewSettings video{.format = PixelFormat::i420};
  const auto cuda = renderer_of(scene, RendererKind::cuda)->make_view(video);
  const auto cpu_renderer = renderer_of(scene, RendererKind::cpu);
  const auto cpu = cpu_renderer->make_view(video);
  FrameView a, b;
  ASSERT_TRUE(cuda->render(scene.request, a).ok());
  ASSERT_TRUE(cpu->render(scene.request, b).ok());
  for (int plane = 0; plane < 3; ++plane) {
    const glm::ivec2 size = plane == 0 ? a.size_px : a.size_px / 2;
    int worst = 0;
    for (int y = 0; y < size.y; ++y) {
      for (int x = 0; x < size.x; ++x) {
        const auto at = [&](const FrameView& f) {
          return static_cast<int>(f.planes[plane].data[f.planes[plane].stride_bytes * y + x]);
        };
        worst = std::max(worst, std::abs(at(a) - at(b)));
      }
    }
    EXPECT_LE(worst, 2) << "plane " << plane;
  }
}

TEST_F(CudaRenderer, TileLoadsAddUpToTheLists) {
  const TestScene scene = random_scene(20'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::vanilla, Pipeline::catgs}) {
    const auto view = renderer->make_view({.pipeline = pipeline});
    EXPECT_TRUE(view->tile_loads().empty());
    const FrameStats stats = render_in(*view, scene.request).stats;
    const std::vector<std::uint32_t> loads = view->tile_loads();
    const bool vanilla = pipeline == Pipeline::vanilla;  // its tiles have 16 px
    EXPECT_EQ(loads.size(), vanilla ? 40u * 23u : 20u * 12u);
    const std::uint64_t sum = std::accumulate(loads.begin(), loads.end(), std::uint64_t{0});
    EXPECT_LE(sum, stats.list_entries);
    EXPECT_GE(sum + stats.list_entries / 50, stats.list_entries);  // some reach no block
    EXPECT_EQ(*std::max_element(loads.begin(), loads.end()), stats.list_max);
  }
}

TEST_F(CudaRenderer, LongTilesAreSplit) {
  TestScene scene = random_scene(200'000);
  // The whole scene lies in a few of the tiles.
  scene.request.camera = make_camera(Pose{}, {512, 512}, 40.0f);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto split = renderer->make_view({}), whole = renderer->make_view({.split_tasks = false});
  const Rendered b = render_in(*whole, scene.request);
  EXPECT_EQ(b.stats.tasks, 256u);  // one a tile
  for (int frame = 0; frame < 4; ++frame) {
    const Rendered a = render_in(*split, scene.request);
    EXPECT_GT(a.stats.tasks, b.stats.tasks);
    EXPECT_GE(test::psnr_db(a.rgb, b.rgb), 60.0);
  }
}

// A pixel that two black layers finish keeps a hundredth of its light for the background: nothing
// of the white ones behind shows, in whatever slices they are.
TEST_F(CudaRenderer, NothingShowsBehindAFinishedPixel) {
  constexpr int layers = 4000;
  GaussianCloud cloud;
  cloud.resize(layers, 0);
  for (int i = 0; i < layers; ++i) {
    const bool faint = i == 0, black = i < 3;
    cloud.mean[i] = {0.0f, 0.0f, 5.0f + 1e-3f * static_cast<float>(i)};
    cloud.scale[i] = glm::vec3(1.0f, 1.0f, 1e-3f);
    cloud.rotation[i] = glm::quat(1.0f, 0.0f, 0.0f, 0.0f);
    cloud.opacity[i] = faint ? 0.05f : 0.9999f;
    cloud.sh[i] = glm::vec3(black ? -1.7f : 1.7f);
  }
  TestScene scene;
  scene.cloud = std::make_shared<const GaussianCloud>(std::move(cloud));
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto split = renderer->make_view({}), whole = renderer->make_view({.split_tasks = false});
  // Most tiles are empty; all are full, and want more slices than there is room for.
  for (const float focal_px : {80.0f, 4000.0f}) {
    scene.request.camera = make_camera(Pose{}, {512, 512}, focal_px);
    const Rendered b = render_in(*whole, scene.request);
    for (int frame = 0; frame < 3; ++frame) {
      const Rendered a = render_in(*split, scene.request);
      if (focal_px < 100.0f) {
        EXPECT_GT(a.stats.tasks, b.stats.tasks);
      }
      for (std::size_t i = 0; i < a.rgb.size(); ++i) ASSERT_NEAR(a.rgb[i], b.rgb[i], 1e-3f) << i;
    }
  }
}

// Against the reference, at its worst: two layers leave a little less than what the next one, as
// opaque as may be, brings below transmittance_min. The reference finishes the pixel without it;
// the round takes it in, wherever in the round it stands, and the others behind it.
TEST_F(CudaRenderer, TheRestOfARoundAddsNoMoreThanItsBound) {
  constexpr double bound = transmittance_min / (1.0 - alpha_max);
  for (const int before : {0, 1, 7, 8, 27, 28, 29, 30, 31, 32, 62}) {
    GaussianCloud cloud;
    cloud.resize(static_cast<std::size_t>(before) + 2 + 40, 0);
    for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
      const int point = i - before;
      cloud.mean[i] = {0.0f, 0.0f, 5.0f + 1e-2f * static_cast<float>(i)};
      cloud.scale[i] = glm::vec3(40.0f, 40.0f, 1e-3f);  // as good as constant over the picture
      cloud.rotation[i] = glm::quat(1.0f, 0.0f, 0.0f, 0.0f);
      // Beside what stands before: 0.1 * 0.09 = 0.009 is left, of which the next leaves 0.00009.
      cloud.opacity[i] = point < 0 ? 1.1f / 255.0f : point == 0 ? 0.9f : point == 1 ? 0.91f : 1.0f;
      cloud.sh[i] = glm::vec3(point < 2 ? -1.7f : 1.7f);
    }
    TestScene scene;
    scene.cloud = std::make_shared<const GaussianCloud>(std::move(cloud));
    scene.request.camera = make_camera(Pose{}, {64, 48}, 60.0f);
    const Rendered cuda = render(*renderer_of(scene, RendererKind::cuda), scene.request);
    const Rendered reference = render(*renderer_of(scene, RendererKind::reference), scene.request);
    double most = 0.0;
    for (std::size_t i = 0; i < cuda.rgb.size(); ++i)
      most = std::max(most, std::abs(double{cuda.rgb[i]} - double{reference.rgb[i]}));
    EXPECT_LE(most, bound) << before;
    EXPECT_GE(most, before <= 1 ? 0.5 * bound : 0.0) << before;  // the case is the one meant
  }
}

TEST_F(CudaRenderer, CutsOfTreesAreThoseOfTheCpuCore) {
  const test::TreeScenes scenes;
  const auto cuda = scenes.in_pages(), cpu = scenes.in_pages(1u << 28, RendererKind::cpu);
  for (const float distance : {3.0f, 25.0f, 60.0f, 200.0f}) {
    const FrameRequest request = test::tree_request(distance, 3.0f);
    const Rendered drawn = render(*cuda, request), expected = render(*cpu, request);
    EXPECT_NEAR(drawn.stats.nodes, expected.stats.nodes, 2 + expected.stats.nodes / 100);
    EXPECT_NEAR(drawn.stats.finest_level, expected.stats.finest_level, 1);
    EXPECT_NEAR(drawn.stats.coarsest_level, expected.stats.coarsest_level, 1);
    EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), 50.0) << "from " << distance;
  }
}

}  // namespace
}  // namespace catgs
