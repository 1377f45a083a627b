// Pipeline::catgs against the core's exact pipeline at the same poses.
#include "render_core/motion/script.h"
#include "render_core/synth/synth.h"
#include "tests/render_core/cores/core_test.h"
#include "tests/support/catgs_views.h"

namespace catgs::test {
namespace {

using CatgsViews = CoreTest;

TEST_F(CatgsViews, KeepsItsQualityOnScriptedMotion) {
  ThreadPool pool(2);
  // The tiles of the CUDA core are larger: 20,000 Gaussians hide hardly anything from it.
  const Scene scene =
      synthesize(SynthKind::city, core == RendererKind::cuda ? 200'000 : 20'000, 1, pool);
  const auto renderer = core_renderer_of(std::make_shared<const GaussianCloud>(scene.cloud));
  for (const std::string script : {"walk", "head", "drone", "orbit"})
    for (const double rate_hz : {30.0, 120.0}) {
      SCOPED_TRACE(testing::Message() << script << " at " << rate_hz << " Hz");
      PathQuality quality;
      quality.follow(
          *renderer,
          resample(make_script({.script = script, .duration_s = 0.6}, scene.hints), rate_hz));
      quality.expect_good();
      if (core == RendererKind::cuda && rate_hz > 100.0) {
        EXPECT_GT(quality.sub_frames, quality.frames / 4);
      }
    }
}

TEST_F(CatgsViews, DrawsNothingThatAWallHides) {
  const auto renderer = core_renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  const FrameRequest request = request_at({});
  const Rendered expected = render_in(*exact, request);
  EXPECT_EQ(render_in(*view, request).stats.visible, expected.stats.visible) << "nothing is known";
  for (int frame = 0; frame < 3; ++frame) {
    const Rendered drawn = render_in(*view, request);
    EXPECT_LT(2 * drawn.stats.visible, expected.stats.visible);
    EXPECT_LT(2 * drawn.stats.list_entries, expected.stats.list_entries);
    EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 45.0);
  }
}

TEST_F(CatgsViews, ALeapOfTheCameraHidesNothing) {
  const auto renderer = core_renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  // Beyond the wall, to the side, and the other way round.
  const Pose leaps[] = {
      {{0, 0, 5}, {1, 0, 0, 0}}, {{30, 0, 0}, {1, 0, 0, 0}}, {{0, 0, 40}, {0, 0, 1, 0}}};
  for (const Pose& leap : leaps) {
    for (int frame = 0; frame < 2; ++frame) render_in(*view, request_at({}));
    const Rendered drawn = render_in(*view, request_at(leap));
    const Rendered expected = render_in(*exact, request_at(leap));
    EXPECT_EQ(drawn.stats.visible, expected.stats.visible);
    EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 45.0);
  }
}

// The camera goes along the plate and looks past its edge.
TEST_F(CatgsViews, DrawsWhatComesOutBehindAnEdge) {
  const auto renderer = core_renderer_of(plate_before_pattern());
  for (const float step : {0.005f, 0.02f, 0.05f, -0.02f}) {
    SCOPED_TRACE(step);
    const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
    PathQuality quality;
    std::uint32_t hidden = 0;
    const auto after = [&](int frames) {
      return Pose{{step * static_cast<float>(frames), 0, 0}, {1, 0, 0, 0}};
    };
    for (int k = 0; k < 20; ++k) {
      FrameRequest request = request_at(after(k));
      request.forecast = Forecast{after(k + 8), 8};
      const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
      hidden += expected.stats.visible - drawn.stats.visible;
      quality.add(drawn, expected, request.camera.size_px);
    }
    EXPECT_GE(quality.worst_frame, 45.0);
    EXPECT_GE(quality.worst_block, 30.0);
    EXPECT_GT(hidden, 0u);
  }
}

}  // namespace
}  // namespace catgs::test
