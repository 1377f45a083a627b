// Scenes in pages.
#include <chrono>
#include <cmath>
#include <thread>

#include "render_core/base/error.h"
#include "tests/render_core/cores/tree_views.h"
#include "tests/support/rendered.h"
#include "tests/support/surface_clouds.h"

namespace catgs::test {
namespace {

using TreeViews = CoreTest;

/// Pools of so many slots each.
std::shared_ptr<PagePools> pools_of(std::uint32_t slots) {
  const TreeScenes scenes;
  const PageFigures least = scenes.in_pages(std::make_shared<PagePools>(1))->pages().at(0);
  return std::make_shared<PagePools>(least.pool_bytes / least.slots * slots);
}

// On a GPU, the whole scene is packed once more.
TEST_F(TreeViews, ZeroDetailIsTheWholeScene) {
  const TreeScenes scenes;
  const auto paged = scenes.in_pages(), whole = scenes.whole();
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::paper, Pipeline::catgs}) {
    const auto view = paged->make_view({.pipeline = pipeline});
    const auto expected_view = whole->make_view({.pipeline = pipeline});
    for (const float distance : {3.0f, 3.05f, 30.0f}) {
      const FrameRequest request = tree_request(distance, 0.0f);
      const Rendered drawn = render_in(*view, request);
      const Rendered expected = render_in(*expected_view, request);
      EXPECT_NEAR(drawn.stats.visible, expected.stats.visible, 2 + expected.stats.visible / 500);
      EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), core == RendererKind::cuda ? 50.0 : 70.0)
          << "from " << distance;
      EXPECT_EQ(drawn.stats.missing_pages, 0u);
      EXPECT_EQ(drawn.stats.finest_level, 0);
      EXPECT_EQ(drawn.stats.coarsest_level, 0);
    }
  }
}

TEST_F(TreeViews, DetailLeavesOutLittle) {
  const TreeScenes scenes;
  const auto renderer = scenes.in_pages();
  const auto view = renderer->make_view({});
  const Rendered all = render_in(*view, tree_request(60.0f, 0.0f));
  double before = all.stats.visible, quality_db = 200.0;
  for (const float detail_px : {2.0f, 4.0f, 8.0f}) {
    const Rendered drawn = render_in(*view, tree_request(60.0f, detail_px));
    EXPECT_LT(drawn.stats.visible, 0.8 * before) << detail_px << " px";
    const double now_db = psnr_db(drawn.rgb, all.rgb);
    EXPECT_LT(now_db, quality_db);
    EXPECT_GE(now_db, 25.0) << detail_px << " px";
    before = drawn.stats.visible;
    quality_db = now_db;
  }
}

// A closed surface stays closed in coarse levels. Its pictures have 36.0 dB; merged Gaussians that
// do not grow let the background through, and have 32.9.
TEST_F(TreeViews, CutsOfARoomKeep35Db) {
  GaussianCloud cloud = room();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const glm::vec3& at = cloud.mean[i];
    cloud.sh[i] = {std::sin(3.0f * at.x) * std::cos(2.0f * at.z), std::cos(4.0f * at.y + at.x),
                   0.5f * std::sin(5.0f * at.z)};
  }
  ThreadPool pool(2);
  RendererOptions options;
  options.kind = core;
  const auto renderer =
      make_renderer(std::make_shared<TreeFile>(source_of(tree_bytes(cloud, pool))), options)
          .renderer;
  const auto view = renderer->make_view({});
  FrameRequest request = tree_request(0.0f, 0.0f);
  request.camera =
      make_camera(look_at({-3.5f, 0.3f, -2.5f}, {1.0f, 0.0f, 1.0f}), {320, 192}, 160.0f);
  const Rendered all = render_in(*view, request);
  request.detail_px = 4.0f;
  const Rendered cut = render_in(*view, request);
  EXPECT_GE(cut.stats.coarsest_level, 2);
  EXPECT_LT(cut.stats.visible, all.stats.visible / 2);
  EXPECT_GE(psnr_db(cut.rgb, all.rgb), 35.0);
}

// A flight through all levels: no step may change the picture by more than the steps of the whole
// scene do.
TEST_F(TreeViews, NothingPops) {
  const TreeScenes scenes;
  const auto renderer = scenes.in_pages();
  const auto cut = renderer->make_view({}), all = renderer->make_view({});
  const auto mean_change = [](const std::vector<float>& a, const std::vector<float>& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(static_cast<double>(a[i] - b[i]));
    return sum / static_cast<double>(a.size());
  };
  Rendered cut_before, all_before;
  for (int step = 0; step <= 100; ++step) {
    const float distance = 20.0f * std::pow(1.003f, static_cast<float>(step));
    const Rendered cut_now = render_in(*cut, tree_request(distance, 4.0f));
    const Rendered all_now = render_in(*all, tree_request(distance, 0.0f));
    if (step > 0) {
      EXPECT_LE(mean_change(cut_now.rgb, cut_before.rgb),
                mean_change(all_now.rgb, all_before.rgb) + 1.0 / 255.0)
          << "step " << step;
    }
    cut_before = cut_now;
    all_before = all_now;
  }
}

// With room for few pages, the picture is coarser. It has no holes: where all of the scene hides
// the background, so does what is there of it.
TEST_F(TreeViews, ShortMemoryIsCoarser) {
  const TreeScenes scenes;
  const auto few = scenes.in_pages(1);
  const auto view = few->make_view({});
  FrameRequest request = tree_request(8.0f, 0.0f);
  const Rendered coarse = render_in(*view, request);
  const Rendered all = render_in(*scenes.whole()->make_view({}), request);
  EXPECT_EQ(coarse.stats.missing_pages, 0u) << "none has room";
  EXPECT_GT(coarse.stats.coarsest_px, 0.0f);
  EXPECT_GT(coarse.stats.coarsest_level, 0);
  EXPECT_LE(coarse.stats.finest_level, coarse.stats.coarsest_level);
  EXPECT_LT(few->scene_bytes(), scenes.bytes.size());
  request.background = glm::vec3(1.0f);
  const Rendered coarse_on_white = render_in(*view, request);
  const Rendered all_on_white = render_in(*scenes.whole()->make_view({}), request);
  std::size_t hidden = 0, holes = 0;
  for (std::size_t i = 0; i < all.rgb.size(); ++i) {
    if (all_on_white.rgb[i] - all.rgb[i] > 0.02f) continue;
    ++hidden;
    holes += coarse_on_white.rgb[i] - coarse.rgb[i] > 0.5f ? 1 : 0;
  }
  EXPECT_GT(hidden, all.rgb.size() / 20);
  EXPECT_LE(holes, hidden / 200);
}

// At any size of a pool, the cut is as coarse as it must be to be whole, and no coarser.
TEST_F(TreeViews, CutsFitSmallPools) {
  const TreeScenes scenes;
  const Rendered all = render_in(*scenes.whole()->make_view({}), tree_request(8.0f, 0.0f));
  double quality_db = 0.0;
  float coarsest_px = 1e9f;
  for (const std::uint32_t slots : {4u, 6u, 10u}) {
    const auto renderer = scenes.in_pages(pools_of(slots));
    const auto view = renderer->make_view({});  // without it, a reserve of memory is made
    const Rendered drawn = render_in(*view, tree_request(8.0f, 0.0f));
    EXPECT_EQ(drawn.stats.missing_pages, 0u) << slots << " slots";
    EXPECT_TRUE(drawn.stats.settled) << slots << " slots";
    EXPECT_LE(drawn.stats.coarsest_px, coarsest_px) << slots << " slots";
    EXPECT_GE(renderer->pages().at(0).in_memory + 2, slots) << "memory is used";
    EXPECT_GT(psnr_db(drawn.rgb, all.rgb), quality_db) << slots << " slots";
    coarsest_px = drawn.stats.coarsest_px;
    quality_db = psnr_db(drawn.rgb, all.rgb);
  }
}

// Two trees of different pages in a pool that is too small for either. Each draws as in a pool of
// its own when the other has no View.
TEST_F(TreeViews, TreesShareAPool) {
  constexpr std::uint32_t slots = 12;
  const TreeScenes low(1, 21), high(3, 22);
  const auto pools = pools_of(slots);
  const auto first = low.in_pages(pools);
  EXPECT_EQ(first->pages().at(0).slots, slots);
  FrameRequest request = tree_request(8.0f, 0.0f);
  const auto alone = [&](const TreeScenes& scenes) {
    const PageFigures least = scenes.in_pages(1)->pages().at(0);
    // The root of the other tree takes a slot of the shared pool.
    const auto own = scenes.in_pages(least.pool_bytes / least.slots * (slots - 1));
    EXPECT_EQ(own->pages().at(0).slots, slots - 1);
    return render_in(*own->make_view({}), request);
  };
  const Rendered low_alone = alone(low), high_alone = alone(high);
  EXPECT_GT(low_alone.stats.coarsest_px, 0.0f);
  {
    const auto second = high.in_pages(pools);
    const auto expect_same = [&](Renderer& renderer, const Rendered& expected) {
      const Rendered drawn = render_in(*renderer.make_view({}), request);
      EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 90.0);
      EXPECT_EQ(drawn.stats.nodes, expected.stats.nodes);
      EXPECT_EQ(drawn.stats.coarsest_level, expected.stats.coarsest_level);
    };
    expect_same(*first, low_alone);
    expect_same(*second, high_alone);
    EXPECT_LE(first->pages().at(0).in_memory, 3u) << "an idle tree gives its pages up";
    expect_same(*first, low_alone);
    EXPECT_LE(second->pages().at(0).in_memory, 3u);
    // Both at once are coarser, and not wrong.
    const auto a = first->make_view({}), b = second->make_view({});
    const Rendered low_beside = render_in(*a, request), high_beside = render_in(*b, request);
    EXPECT_GE(psnr_db(low_beside.rgb, low_alone.rgb), 20.0);
    EXPECT_GE(psnr_db(high_beside.rgb, high_alone.rgb), 20.0);
  }
  const PageFigures left = first->pages().at(0);
  EXPECT_EQ(left.free_slots, slots - left.in_memory) << "a tree that goes frees its slots";
}

// A View at rest that is short of memory has its last picture at some time, and reads no more.
TEST_F(TreeViews, AViewAtRestSettles) {
  const TreeScenes scenes;
  const auto renderer = scenes.in_pages(pools_of(7));
  const auto view = renderer->make_view({.pipeline = Pipeline::catgs});
  FrameRequest request = tree_request(8.0f, 0.0f);
  request.waits_for_pages = false;
  Rendered drawn;
  for (int frame = 0; frame < 1000 && (frame < 2 || !drawn.stats.settled); ++frame) {
    drawn = render_in(*view, request);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_TRUE(drawn.stats.settled);
  EXPECT_EQ(drawn.stats.missing_pages, 0u) << "the cut fits the pool";
  EXPECT_GT(drawn.stats.coarsest_px, 0.0f);
  const PageFigures figures = renderer->pages().at(0);
  EXPECT_EQ(figures.loaded, figures.in_memory) << "what was read is there";
  for (int frame = 0; frame < 10; ++frame) EXPECT_TRUE(render_in(*view, request).stats.settled);
  EXPECT_EQ(renderer->pages().at(0).loaded, figures.loaded);
}

TEST_F(TreeViews, SubFramesKeepTheCut) {
  const TreeScenes scenes;
  const auto renderer = scenes.in_pages();
  const auto view = renderer->make_view({.pipeline = Pipeline::paper});
  FrameRequest request = tree_request(40.0f, 3.0f);
  request.forecast = Forecast{.world_from_camera = request.camera.world_from_camera, .frames = 4};
  const Rendered key = render_in(*view, request);
  EXPECT_EQ(key.stats.kind, FrameKind::key);
  request.waits_for_pages = false;
  const Rendered sub = render_in(*view, request);
  EXPECT_EQ(sub.stats.kind, FrameKind::sub);
  EXPECT_GE(psnr_db(sub.rgb, key.rgb), 60.0);
}

TEST_F(TreeViews, VanillaIsRefused) {
  const TreeScenes scenes;
  const auto renderer = scenes.in_pages();
  EXPECT_THROW((void)renderer->make_view({.pipeline = Pipeline::vanilla}), InputError);
}

TEST_F(TreeViews, TheReferenceDrawsNoParts) {
  const TreeScenes scenes;
  EXPECT_THROW((void)scenes.in_pages(1u << 28, RendererKind::reference), InputError);
}

}  // namespace
}  // namespace catgs::test
