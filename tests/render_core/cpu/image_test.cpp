// Whole images of the CPU core against the reference.

#include <gtest/gtest.h>

#include "render_core/renderer.h"
#include "render_core/thread_pool.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::TestScene;

std::shared_ptr<ThreadPool> pool_of(int threads) { return std::make_shared<ThreadPool>(threads); }

struct Rendered {
  std::vector<float> rgb;
  FrameStats stats;
};

Rendered render(const TestScene& scene, const RendererOptions& options,
                const ViewSettings& settings = {}) {
  const auto renderer = make_renderer(scene.cloud, options).renderer;
  const auto view = renderer->make_view(settings);
  FrameView frame;
  const RenderStatus status = view->render(scene.request, frame);
  EXPECT_TRUE(status.ok()) << status.message;
  return {test::copy_rgb(frame), frame.stats};
}

class SmallScenes : public testing::TestWithParam<TestScene> {};

TEST_P(SmallScenes, ExactMatchesReference) {
  const auto reference = render(GetParam(), {RendererKind::reference, pool_of(2), "auto"});
  for (const std::string_view simd : simd_targets()) {
    const auto exact = render(GetParam(), {RendererKind::cpu, pool_of(2), std::string(simd)});
    EXPECT_GE(test::psnr_db(exact.rgb, reference.rgb), 60.0) << simd;
    EXPECT_EQ(exact.stats.overflowed_entries, 0u);
    RecordProperty("psnr_" + std::string(simd),
                   std::to_string(test::psnr_db(exact.rgb, reference.rgb)));
  }
}

TEST_P(SmallScenes, VanillaMatchesExact) {
  const auto exact = render(GetParam(), {RendererKind::cpu, pool_of(2), "auto"});
  const auto vanilla =
      render(GetParam(), {RendererKind::cpu, pool_of(2), "auto"}, {.pipeline = Pipeline::vanilla});
  EXPECT_GE(test::psnr_db(vanilla.rgb, exact.rgb), 55.0);
  RecordProperty("psnr", std::to_string(test::psnr_db(vanilla.rgb, exact.rgb)));
}

TEST_P(SmallScenes, ThreadsDoNotChangeTheImage) {
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::vanilla}) {
    const ViewSettings settings{.pipeline = pipeline};
    const auto one = render(GetParam(), {RendererKind::cpu, pool_of(1), "auto"}, settings);
    const auto many = render(GetParam(), {RendererKind::cpu, pool_of(5), "auto"}, settings);
    EXPECT_EQ(one.rgb, many.rgb);
    EXPECT_EQ(one.stats.list_entries, many.stats.list_entries);
  }
}

INSTANTIATE_TEST_SUITE_P(, SmallScenes, testing::ValuesIn(test::small_scenes()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace catgs
