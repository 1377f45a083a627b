// The depth grids of frames for clients, against those of the reference.
#include <cmath>
#include <memory>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/synth/synth.h"
#include "tests/render_core/cores/core_test.h"
#include "tests/support/catgs_views.h"

namespace catgs::test {
namespace {

using Depths = CoreTest;

std::vector<float> grid_in(View& view, const FrameRequest& request) {
  FrameView frame;
  const RenderStatus status = view.render(request, frame);
  EXPECT_TRUE(status.ok()) << status.message;
  EXPECT_EQ(frame.depths.cells, request.depth_cells);
  return {frame.depths.inverse_depths.begin(), frame.depths.inverse_depths.end()};
}

TEST_F(Depths, AreThoseOfTheReference) {
  ThreadPool pool(2);
  const Scene scene = synthesize(SynthKind::city, 20'000, 1, pool);
  const auto cloud = std::make_shared<const GaussianCloud>(scene.cloud);
  FrameRequest request;
  request.camera = make_camera(scene.hints.start_pose, {320, 180}, 200.0f);
  request.depth_cells = {16, 9};
  const auto expected =
      grid_in(*core_renderer_of(cloud, RendererKind::reference)->make_view({}), request);
  const auto renderer = core_renderer_of(cloud);
  const auto view = renderer->make_view({Pipeline::catgs, PixelFormat::i420});
  for (int frame = 0; frame < 2; ++frame) {  // the second hides what the first has not shown
    const std::vector<float> grid = grid_in(*view, request);
    ASSERT_EQ(grid.size(), expected.size());
    int near = 0;
    for (std::size_t i = 0; i < grid.size(); ++i)
      near += std::abs(grid[i] - expected[i]) <= 0.05f * expected[i];
    EXPECT_GE(near, 16 * 9 * 8 / 10) << frame;  // others have two surfaces
  }
}

TEST_F(Depths, FollowTheSizeThatIsAskedFor) {
  const auto renderer = core_renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings);
  FrameRequest request = request_at({}, {163, 91});
  for (const glm::ivec2 cells : {glm::ivec2(1), glm::ivec2(64, 36), glm::ivec2(0),
                                 glm::ivec2(max_depth_cells), glm::ivec2(16, 9)}) {
    request.depth_cells = cells;
    const std::vector<float> grid = grid_in(*view, request);
    ASSERT_EQ(grid.size(), static_cast<std::size_t>(cells.x * cells.y));
    for (const float inverse_depth : grid)
      ASSERT_NEAR(inverse_depth, 0.25f, 0.008f);  // walls at 4 and 4.1
  }
}

}  // namespace
}  // namespace catgs::test
