#pragma once

// Clip planes in any core.

#include <memory>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "render_core/frame/renderer.h"
#include "render_core/scene/keep_if.h"
#include "tests/support/catgs_views.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"
#include "tests/support/tree_views.h"

namespace catgs::test {

inline std::unique_ptr<Renderer> renderer_of_kind(RendererKind kind, GaussianCloud cloud) {
  RendererOptions options;
  options.kind = kind;
  return make_renderer(std::make_shared<const GaussianCloud>(std::move(cloud)), options).renderer;
}

/// A clipped picture is that of the Gaussians that are left. `pipelines`: those of the core.
inline void expect_clipped_pictures_to_be_those_of_the_rest(
    RendererKind kind, const std::vector<Pipeline>& pipelines) {
  const ClipPlane clip{{0.4f, 2.0f, -0.2f}, 0.3f};
  const GaussianCloud all = random_cloud(20'000, 1, 5);
  GaussianCloud rest = all;
  keep_if(rest, [&](std::size_t i) { return glm::dot(clip.normal, all.mean[i]) <= clip.offset; });
  ASSERT_LT(rest.size(), 15'000u);
  ASSERT_GT(rest.size(), 5'000u);
  const auto whole = renderer_of_kind(kind, all), part = renderer_of_kind(kind, std::move(rest));
  for (const Pipeline pipeline : pipelines) {
    SCOPED_TRACE(static_cast<int>(pipeline));
    const ViewSettings settings{.pipeline = pipeline};
    const auto clipped = whole->make_view(settings), expected = part->make_view(settings);
    for (const float x : {0.0f, 0.05f}) {
      FrameRequest request = request_at({{x, 0, 0}, {1, 0, 0, 0}});
      const Rendered picture = render_in(*expected, request);
      request.camera.clip = clip;
      EXPECT_GE(psnr_db(render_in(*clipped, request).rgb, picture.rgb), 55.0);
    }
  }
}

inline void expect_a_clipped_wall_to_hide_nothing(RendererKind kind) {
  const auto renderer = renderer_of_kind(kind, *wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  FrameRequest request = request_at({});
  for (int frame = 0; frame < 3; ++frame) render_in(*view, request);
  request.camera.clip = {{0, 0, -1}, -5};
  const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
  EXPECT_GT(expected.stats.visible, 1'000u);
  EXPECT_EQ(drawn.stats.visible, expected.stats.visible);
  EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 45.0);
}

inline void expect_another_clip_plane_to_end_a_window(RendererKind kind) {
  const auto renderer = renderer_of_kind(kind, random_cloud(5'000, 0, 5));
  const auto view = renderer->make_view({.pipeline = Pipeline::paper});
  FrameRequest request = request_at({});
  request.forecast = Forecast{request.camera.world_from_camera, 4};
  EXPECT_EQ(render_in(*view, request).stats.kind, FrameKind::key);
  EXPECT_EQ(render_in(*view, request).stats.kind, FrameKind::sub);
  request.camera.clip = {{0, 1, 0}, 0};
  EXPECT_EQ(render_in(*view, request).stats.kind, FrameKind::key);
}

inline void expect_trees_to_be_clipped(RendererKind kind) {
  const TreeScenes scenes;
  FrameRequest request = tree_request(20.0f, 0.0f);
  request.camera.clip = {{0, 1, 0}, 0};
  const auto of_tree = render_in(*scenes.in_pages(kind)->make_view({}), request);
  const auto of_cloud = render_in(*scenes.whole(kind)->make_view({}), request);
  EXPECT_GE(psnr_db(of_tree.rgb, of_cloud.rgb), 50.0);
  request.camera.clip = {};
  EXPECT_LT(psnr_db(of_tree.rgb, render_in(*scenes.whole(kind)->make_view({}), request).rgb), 30.0);
}

}  // namespace catgs::test
