// The depth grid of the CPU core against the depths of the reference.

#include <algorithm>
#include <array>
#include <cmath>
#include <ranges>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/kernels.h"
#include "render_core/frame/renderer.h"
#include "render_core/synth/synth.h"
#include "tests/support/catgs_views.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

std::vector<float> grid_of(const std::shared_ptr<const GaussianCloud>& cloud,
                           const FrameRequest& request, const ViewSettings& settings,
                           RendererKind kind = RendererKind::cpu,
                           const std::string& simd = "auto") {
  const auto renderer =
      make_renderer(cloud, {kind, std::make_shared<ThreadPool>(2), simd}).renderer;
  const auto view = renderer->make_view(settings);
  FrameView frame;
  const RenderStatus status = view->render(request, frame);
  EXPECT_TRUE(status.ok()) << status.message;
  EXPECT_EQ(frame.depths.cells, request.depth_cells);
  return {frame.depths.inverse_depths.begin(), frame.depths.inverse_depths.end()};
}

class DepthGrids : public testing::TestWithParam<Pipeline> {
 protected:
  [[nodiscard]] ViewSettings settings() const { return {.pipeline = GetParam()}; }
};

TEST_P(DepthGrids, CellsHaveTheMedianOfTheirPixels) {
  ThreadPool pool(2);
  const Scene scene = synthesize(SynthKind::city, 20'000, 1, pool);
  FrameRequest request;
  request.camera = make_camera(scene.hints.start_pose, {320, 180}, 200.0f);
  request.depth_cells = {16, 9};
  const auto cloud = std::make_shared<const GaussianCloud>(scene.cloud);
  const std::vector<float> reference = grid_of(cloud, request, {}, RendererKind::reference);
  for (const std::string_view simd : std::views::transform(simd_kernels(), &SimdKernels::name)) {
    const auto grid = grid_of(cloud, request, settings(), RendererKind::cpu, std::string(simd));
    ASSERT_EQ(grid.size(), reference.size());
    int near = 0;
    for (std::size_t i = 0; i < grid.size(); ++i)
      near += std::abs(grid[i] - reference[i]) <= 0.05f * reference[i];
    EXPECT_GE(near, 16 * 9 * 9 / 10) << simd;  // others have two surfaces
  }
}

TEST_P(DepthGrids, HoldTheInverseDepthOfAWall) {
  FrameRequest request = test::request_at({}, {163, 91});
  for (const glm::ivec2 cells : {glm::ivec2(1), glm::ivec2(16, 9), glm::ivec2(64, 36),
                                 glm::ivec2(max_depth_cells)}) {  // cells smaller than pixels, too
    request.depth_cells = cells;
    for (const float inverse_depth : grid_of(test::wall_before_many(), request, settings()))
      ASSERT_NEAR(inverse_depth, 0.25f, 0.008f) << cells.x;  // walls at 4 and 4.1
  }
}

TEST_P(DepthGrids, HoldZeroWhereLightPasses) {
  GaussianCloud cloud;
  for (int k = 0; k < 900; ++k)  // left of the view axis only
    test::add_opaque(
        cloud,
        {-0.2f - 0.1f * static_cast<float>(k % 30), 0.1f * static_cast<float>(k / 30 - 15), 4.0f},
        {0.1f, 0.1f, 0.01f}, glm::vec3(1.0f));
  FrameRequest request = test::request_at({}, {320, 192});
  request.depth_cells = {4, 1};
  const auto grid =
      grid_of(std::make_shared<const GaussianCloud>(std::move(cloud)), request, settings());
  EXPECT_NEAR(grid.front(), 0.25f, 1e-4f);
  EXPECT_EQ(grid.back(), 0.0f);
}

TEST_P(DepthGrids, AreFiniteInDifficultScenes) {
  for (const test::TestScene& scene : test::small_scenes()) {
    FrameRequest request = scene.request;
    request.depth_cells = {5, 3};
    for (const float inverse_depth : grid_of(scene.cloud, request, settings())) {
      ASSERT_GE(inverse_depth, 0.0f) << scene.name;
      ASSERT_LE(inverse_depth, 1.0f / request.camera.near_z) << scene.name;
    }
  }
}

TEST_P(DepthGrids, ChangeNoPixel) {
  FrameRequest request = test::request_at({}, {162, 90});
  const auto cloud = test::wall_before_many();
  const auto renderer =
      make_renderer(cloud, {RendererKind::cpu, std::make_shared<ThreadPool>(2), "auto"}).renderer;
  const auto without = test::render_in(*renderer->make_view(settings()), request);
  request.depth_cells = {64, 36};
  EXPECT_EQ(test::render_in(*renderer->make_view(settings()), request).rgb, without.rgb);
}

std::string name_of(const testing::TestParamInfo<Pipeline>& pipeline) {
  constexpr std::array names = {"vanilla", "exact", "paper", "catgs"};
  return names[static_cast<std::size_t>(pipeline.param)];
}

INSTANTIATE_TEST_SUITE_P(Pipelines, DepthGrids,
                         testing::Values(Pipeline::vanilla, Pipeline::exact, Pipeline::paper,
                                         Pipeline::catgs),
                         name_of);

TEST(DepthGrid, IsNotMadeUnasked) {
  EXPECT_TRUE(grid_of(test::wall_before_many(), test::request_at({}), {}).empty());
}

TEST(DepthGrid, SizesOutOfRangeAreRefused) {
  FrameRequest request = test::request_at({});
  for (const glm::ivec2 cells : {glm::ivec2(0, 4), glm::ivec2(-1, 4), glm::ivec2(4, 129)}) {
    request.depth_cells = cells;
    EXPECT_EQ(check_request(request, PixelFormat::rgb_f32).message,
              "request: depth grid " + std::to_string(cells.x) + "x" + std::to_string(cells.y) +
                  " is outside 1x1…128 a side");
  }
}

}  // namespace
}  // namespace catgs
