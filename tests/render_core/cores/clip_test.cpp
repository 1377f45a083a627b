// Clip planes and boxes.
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/scene/keep_if.h"
#include "tests/render_core/cores/tree_views.h"
#include "tests/support/catgs_views.h"
#include "tests/support/rendered.h"

namespace catgs::test {
namespace {

using Clips = CoreTest;

std::unique_ptr<Renderer> renderer_of(GaussianCloud cloud, RendererKind kind = core) {
  return core_renderer_of(std::make_shared<const GaussianCloud>(std::move(cloud)), kind);
}

struct Clip {
  const char* name;
  ClipBox box;
  std::function<bool(const glm::vec3&)> keeps;
};
const glm::vec3 plane_normal(0.4f, 2.0f, -0.2f), box_middle(0.1f, -0.2f, 5.0f);
const glm::quat box_turn = glm::angleAxis(0.5f, glm::vec3(0, 1, 0));
const std::array clips{
    Clip{"plane", clip_plane(plane_normal, 0.3f),
         [](const glm::vec3& p) { return glm::dot(plane_normal, p) <= 0.3f; }},
    Clip{"box", oriented_box(box_middle, box_turn, {0.9f, 2.0f, 1.1f}), [](const glm::vec3& p) {
           const glm::vec3 local = glm::abs(glm::inverse(box_turn) * (p - box_middle));
           return local.x <= 0.9f && local.y <= 2.0f && local.z <= 1.1f;
         }}};

/// A clipped picture is that of the Gaussians that are left. `pipelines`: those of the core.
void expect_pictures_of_the_rest(const Clip& clip, RendererKind kind,
                                 const std::vector<Pipeline>& pipelines) {
  SCOPED_TRACE(clip.name);
  const GaussianCloud all = random_cloud(20'000, 1, 5);
  GaussianCloud rest = all;
  keep_if(rest, [&](std::size_t i) { return clip.keeps(all.mean[i]); });
  ASSERT_LT(rest.size(), 15'000u);
  ASSERT_GT(rest.size(), 2'000u);
  const auto whole = renderer_of(all, kind), part = renderer_of(std::move(rest), kind);
  for (const Pipeline pipeline : pipelines) {
    SCOPED_TRACE(static_cast<int>(pipeline));
    const ViewSettings settings{.pipeline = pipeline};
    const auto clipped = whole->make_view(settings), expected = part->make_view(settings);
    for (const float x : {0.0f, 0.05f}) {
      FrameRequest request = request_at({{x, 0, 0}, {1, 0, 0, 0}});
      const Rendered picture = render_in(*expected, request);
      request.camera.clip = clip.box;
      EXPECT_GE(psnr_db(render_in(*clipped, request).rgb, picture.rgb), 55.0);
    }
  }
}

TEST_F(Clips, PicturesAreThoseOfTheRest) {
  for (const Clip& clip : clips) {
    expect_pictures_of_the_rest(
        clip, core, {Pipeline::vanilla, Pipeline::exact, Pipeline::paper, Pipeline::catgs});
    expect_pictures_of_the_rest(clip, RendererKind::reference, {Pipeline::exact});
  }
}

TEST_F(Clips, AClippedWallHidesNothing) {
  const auto renderer = renderer_of(*wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  FrameRequest request = request_at({});
  for (int frame = 0; frame < 3; ++frame) render_in(*view, request);
  request.camera.clip = clip_plane({0, 0, -1}, -5);
  const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
  EXPECT_GT(expected.stats.visible, 1'000u);
  EXPECT_EQ(drawn.stats.visible, expected.stats.visible);
  EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 45.0);
}

TEST_F(Clips, AnotherPlaneEndsAWindow) {
  const auto renderer = renderer_of(random_cloud(5'000, 0, 5));
  const auto view = renderer->make_view({.pipeline = Pipeline::paper});
  FrameRequest request = request_at({});
  request.forecast = Forecast{request.camera.world_from_camera, 4};
  EXPECT_EQ(render_in(*view, request).stats.kind, FrameKind::key);
  EXPECT_EQ(render_in(*view, request).stats.kind, FrameKind::sub);
  request.camera.clip = clip_plane({0, 1, 0}, 0);
  EXPECT_EQ(render_in(*view, request).stats.kind, FrameKind::key);
}

TEST_F(Clips, TreesAreClipped) {
  const TreeScenes scenes;
  FrameRequest request = tree_request(20.0f, 0.0f);
  request.camera.clip = clip_plane({0, 1, 0}, 0);
  const auto of_tree = render_in(*scenes.in_pages()->make_view({}), request);
  const auto of_cloud = render_in(*scenes.whole()->make_view({}), request);
  EXPECT_GE(psnr_db(of_tree.rgb, of_cloud.rgb), 50.0);
  request.camera.clip = {};
  EXPECT_LT(psnr_db(of_tree.rgb, render_in(*scenes.whole()->make_view({}), request).rgb), 30.0);
}

TEST_F(Clips, BoxesHaveToBeFiniteAndNotEmpty) {
  const auto renderer = renderer_of(random_cloud(10, 0, 1));
  const float infinite = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  FrameRequest request = request_at({});
  for (const ClipBox& bad : {clip_plane({0, infinite, 0}, 1), clip_plane({0, 1, 0}, nan),
                             oriented_box({}, {1, 0, 0, 0}, {1, -1, 1})}) {
    request.camera.clip = bad;
    FrameView frame;
    EXPECT_EQ(renderer->make_view({})->render(request, frame).code,
              RenderStatus::Code::invalid_request);
  }
}

}  // namespace
}  // namespace catgs::test
