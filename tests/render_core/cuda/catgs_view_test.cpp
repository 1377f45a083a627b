// Pipeline::catgs in the CUDA core against its exact pipeline at the same poses; needs a device.

#include "render_core/motion/script.h"
#include "render_core/synth/synth.h"
#include "tests/render_core/cuda/device.h"
#include "tests/support/catgs_views.h"

namespace catgs {
namespace {

std::unique_ptr<Renderer> renderer_of(std::shared_ptr<const GaussianCloud> cloud) {
  return make_renderer(std::move(cloud), {.kind = RendererKind::cuda, .pool = {}}).renderer;
}

// The city is large enough for this core's tiles: 20,000 Gaussians hide hardly anything from it.
TEST(CudaCatgsView, KeepsItsQualityOnScriptedMotion) {
  REQUIRE_DEVICE();
  ThreadPool pool(2);
  const Scene scene = synthesize(SynthKind::city, 200'000, 1, pool);
  const auto renderer = renderer_of(std::make_shared<const GaussianCloud>(scene.cloud));
  for (const std::string script : {"walk", "head", "drone", "orbit"}) {
    for (const double rate_hz : {30.0, 120.0}) {
      SCOPED_TRACE(testing::Message() << script << " at " << rate_hz << " Hz");
      test::PathQuality quality;
      quality.follow(
          *renderer,
          resample(make_script({.script = script, .duration_s = 0.6}, scene.hints), rate_hz));
      quality.expect_good();
    }
  }
}

TEST(CudaCatgsView, DoesNotDrawWhatAWallHides) {
  REQUIRE_DEVICE();
  test::expect_a_wall_to_hide(*renderer_of(test::wall_before_many()));
}

TEST(CudaCatgsView, ALeapOfTheCameraHidesNothing) {
  REQUIRE_DEVICE();
  test::expect_a_leap_to_hide_nothing(*renderer_of(test::wall_before_many()));
}

TEST(CudaCatgsView, DrawsWhatComesOutBehindAnEdge) {
  REQUIRE_DEVICE();
  test::expect_what_comes_out_behind_an_edge(*renderer_of(test::plate_before_pattern()));
}

}  // namespace
}  // namespace catgs
