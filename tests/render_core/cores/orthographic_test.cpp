// Orthographic pictures.
#include <cmath>
#include <memory>
#include <utility>

#include <glm/common.hpp>

#include "tests/render_core/cores/tree_views.h"
#include "tests/support/catgs_views.h"
#include "tests/support/rendered.h"

namespace catgs::test {
namespace {

using Orthographic = CoreTest;

FrameRequest parallel_request(const Pose& pose, float view_height = 4.0f) {
  FrameRequest request;
  request.camera = make_orthographic_camera(pose, {320, 192}, view_height);
  return request;
}

TEST_F(Orthographic, PicturesEqualTheReference) {
  const std::vector<std::pair<Pipeline, double>> bounds{{Pipeline::exact, 60.0},
                                                        {Pipeline::catgs, 55.0},
                                                        {Pipeline::paper, 60.0},
                                                        {Pipeline::vanilla, 50.0}};
  for (TestScene scene : small_scenes()) {
    SCOPED_TRACE(scene.name);
    const float distance = 5.0f, height = static_cast<float>(scene.request.camera.size_px.y);
    scene.request.camera = make_orthographic_camera(
        scene.request.camera.world_from_camera, scene.request.camera.size_px,
        height * distance / scene.request.camera.focal_px.y, scene.request.camera.near_z);
    const auto renderer = core_renderer_of(scene.cloud);
    const auto oracle = core_renderer_of(scene.cloud, RendererKind::reference)->make_view({});
    const Rendered expected = render_in(*oracle, scene.request);
    for (const auto& [pipeline, bound] : bounds) {
      SCOPED_TRACE(static_cast<int>(pipeline));
      const auto view = renderer->make_view({.pipeline = pipeline});
      for (int frame = 0; frame < 2; ++frame)
        EXPECT_GE(psnr_db(render_in(*view, scene.request).rgb, expected.rgb), bound);
    }
  }
}

/// A perspective camera far away sees what an orthographic one sees.
TEST_F(Orthographic, ReferenceIsTheLimitOfFarCameras) {
  const auto cloud = std::make_shared<const GaussianCloud>(random_cloud(2'000, 3, 5));
  const auto oracle = core_renderer_of(cloud, RendererKind::reference)->make_view({});
  const FrameRequest parallel = parallel_request(look_at({0, 0, -5}, {0, 0, 5}));
  const float distance = 20'000.0f;
  FrameRequest far = parallel;
  far.camera = make_camera(look_at({0, 0, 5 - distance}, {0, 0, 5}), {320, 192},
                           parallel.camera.focal_px.y * distance);
  EXPECT_GE(psnr_db(render_in(*oracle, parallel).rgb, render_in(*oracle, far).rgb), 50.0);
  far.camera.focal_px *= 1.02f;
  EXPECT_LT(psnr_db(render_in(*oracle, parallel).rgb, render_in(*oracle, far).rgb), 40.0);
}

TEST_F(Orthographic, DistanceChangesNothing) {
  const TreeScenes scenes;
  for (const auto& renderer : {scenes.whole(), scenes.in_pages()}) {
    const auto view = renderer->make_view({});
    const auto at = [&](float distance) {
      FrameRequest request = parallel_request(look_at({0, 0, 5 - distance}, {0, 0, 5}), 3.0f);
      request.detail_px = 4.0f;
      request.waits_for_pages = true;
      return render_in(*view, request);
    };
    const Rendered near = at(20.0f), far = at(60.0f);
    EXPECT_EQ(near.stats.visible, far.stats.visible);
    EXPECT_GE(psnr_db(near.rgb, far.rgb), 55.0);
  }
}

TEST_F(Orthographic, TreesAreCutByTheSizeOfTheView) {
  const TreeScenes scenes;
  const auto view = scenes.in_pages()->make_view({}), whole = scenes.whole()->make_view({});
  std::uint32_t drawn = 0;
  for (const float height : {40.0f, 3.0f}) {
    FrameRequest request = parallel_request(look_at({0, 0, -15}, {0, 0, 5}), height);
    request.detail_px = 4.0f;
    request.waits_for_pages = true;
    const Rendered cut = render_in(*view, request);
    EXPECT_GE(psnr_db(cut.rgb, render_in(*whole, request).rgb), 25.0);
    EXPECT_GT(cut.stats.visible, drawn) << "nearer views show more";
    drawn = cut.stats.visible;
  }
}

TEST_F(Orthographic, OtherProjectionsHideNothing) {
  const auto renderer = core_renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  FrameRequest perspective = request_at({});
  FrameRequest parallel = parallel_request({{0, 0, 5}, {1, 0, 0, 0}});
  for (int frame = 0; frame < 3; ++frame) render_in(*view, perspective);
  for (const FrameRequest& request : {parallel, parallel, perspective}) {
    const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
    EXPECT_EQ(drawn.stats.visible, expected.stats.visible);
    EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 50.0);
  }
}

TEST_F(Orthographic, FramesOfPaperAreKeyFrames) {
  const auto renderer = core_renderer_of(wall_before_many());
  const auto view = renderer->make_view({.pipeline = Pipeline::paper});
  FrameRequest perspective = request_at({}), parallel = parallel_request({});
  for (FrameRequest* request : {&perspective, &parallel})
    request->forecast = Forecast{request->camera.world_from_camera, 4};
  const auto kind = [&](const FrameRequest& request) {
    return render_in(*view, request).stats.kind;
  };
  for (const FrameRequest& first : {perspective, parallel, parallel, perspective})
    EXPECT_EQ(kind(first), FrameKind::key);
  EXPECT_EQ(kind(perspective), FrameKind::sub);
}

}  // namespace
}  // namespace catgs::test
