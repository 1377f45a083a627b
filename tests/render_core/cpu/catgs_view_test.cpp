// Pipeline::catgs in the CPU core against its exact pipeline at the same poses.

#include <algorithm>
#include <filesystem>
#include <ranges>
#include <string>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/kernels.h"
#include "render_core/frame/renderer.h"
#include "render_core/motion/anchor.h"
#include "render_core/motion/trajectory.h"
#include "render_core/synth/synth.h"
#include "tests/support/camera_moves.h"
#include "tests/support/catgs_views.h"
#include "tests/support/shared_folder.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::catgs_settings;
using test::PathQuality;
using test::render_in;
using test::Rendered;
using test::request_at;
using test::wall_before_many;

std::unique_ptr<Renderer> renderer_of(std::shared_ptr<const GaussianCloud> cloud, int threads = 2,
                                      const std::string& simd = "auto") {
  return make_renderer(std::move(cloud),
                       {RendererKind::cpu, std::make_shared<ThreadPool>(threads), simd})
      .renderer;
}

TEST(CatgsView, KeepsItsQualityOnRecordedHeads) {
  const auto folder = test::shared_folder("traces/head");
  if (folder.empty()) GTEST_SKIP() << "no shared folder traces/head";
  ThreadPool pool(2);
  const Scene scene = synthesize(SynthKind::city, 20'000, 1, pool);
  const auto renderer = renderer_of(std::make_shared<const GaussianCloud>(scene.cloud));
  int traces = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() != ".tum") continue;
    SCOPED_TRACE(file.path().filename().string());
    const Trajectory path = resample(anchored(read_tum(file.path()), scene.hints), 60.0);
    // A part with much motion in it; all of it would take minutes.
    const auto first = static_cast<std::ptrdiff_t>(std::min<std::size_t>(300, path.size() / 2));
    const auto last = std::min<std::ptrdiff_t>(first + 40, std::ssize(path));
    PathQuality quality;
    quality.follow(*renderer, Trajectory(path.begin() + first, path.begin() + last));
    quality.expect_good();
    ++traces;
  }
  EXPECT_GT(traces, 0);
}

TEST(CatgsView, ANewImageSizeHidesNothing) {
  const auto renderer = renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  for (const glm::ivec2 size : {glm::ivec2(200, 150), glm::ivec2(17, 300), glm::ivec2(64, 64)}) {
    const FrameRequest request = request_at({}, size);
    const Rendered first = render_in(*view, request), second = render_in(*view, request);
    const Rendered expected = render_in(*exact, request);
    EXPECT_EQ(first.stats.visible, expected.stats.visible);
    EXPECT_LT(second.stats.visible, expected.stats.visible);
    EXPECT_GE(test::psnr_db(second.rgb, expected.rgb), 45.0);
  }
}

TEST(CatgsView, DrawsTheSmallestPictures) {
  const auto renderer = renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  for (const glm::ivec2 size : {glm::ivec2(1, 1), glm::ivec2(4, 4), glm::ivec2(5, 3)}) {
    const FrameRequest request = request_at({}, size);
    for (int frame = 0; frame < 3; ++frame)
      EXPECT_GE(test::psnr_db(render_in(*view, request).rgb, render_in(*exact, request).rgb), 40.0);
  }
}

TEST(CatgsView, EachInstructionSetAndAnyNumberOfThreadsDrawTheSame) {
  const auto cloud = wall_before_many();
  const test::Move move = test::moves().back();
  const auto pictures = [&](int threads, const std::string& simd) {
    const auto renderer = renderer_of(cloud, threads, simd);
    const auto view = renderer->make_view(catgs_settings);
    std::vector<Rendered> all;
    Pose pose;
    for (int k = 0; k < 4; ++k) {
      all.push_back(render_in(*view, request_at(pose)));
      pose = test::moved(pose, {"", 0.2f * move.shift, 0.2f * move.turn_rad});
    }
    return all;
  };
  const std::vector<Rendered> expected = pictures(1, "auto");
  const std::vector<Rendered> threaded = pictures(5, "auto");
  for (std::size_t k = 0; k < expected.size(); ++k)
    EXPECT_EQ(threaded[k].rgb, expected[k].rgb) << k;
  for (const std::string_view simd : std::views::transform(simd_kernels(), &SimdKernels::name)) {
    const std::vector<Rendered> other = pictures(2, std::string(simd));
    for (std::size_t k = 0; k < expected.size(); ++k)
      EXPECT_GE(test::psnr_db(other[k].rgb, expected[k].rgb), 60.0) << simd << " " << k;
  }
}

TEST(CatgsView, ARefusedFrameChangesNothing) {
  const auto renderer = renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings);
  render_in(*view, request_at({}));
  const Rendered before = render_in(*view, request_at({}));
  FrameRequest bad = request_at({});
  bad.camera.focal_px.x = -1.0f;
  FrameView frame;
  EXPECT_FALSE(view->render(bad, frame).ok());
  EXPECT_EQ(render_in(*view, request_at({})).rgb, before.rgb);
}

// Strong harmonics, seen by a camera that turns, steps aside and comes back: colours are kept, but
// none for too long. The two Views differ in nothing else.
TEST(CatgsView, ColoursAreKeptWhileTheirDirectionHolds) {
  const test::TestScene scene = test::small_scenes().front();
  const auto renderer = renderer_of(scene.cloud);
  ViewSettings settings = catgs_settings;
  const auto keeping = renderer->make_view(settings);
  settings.colour_cache = false;
  const auto shading = renderer->make_view(settings);
  FrameRequest request = scene.request;
  Pose& pose = request.camera.world_from_camera;
  const auto psnr = [&] {
    return test::psnr_db(render_in(*keeping, request).rgb, render_in(*shading, request).rgb);
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

}  // namespace
}  // namespace catgs
