// The work of a frame against the CPU core's own counts, and against a stack that is known.
#include "render_core/tools/paper/work_count.h"

#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/tools/render_setup.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

/// Sheets across the view, one behind the other, that look the same everywhere in the picture.
GaussianCloud sheets(std::size_t count, float opacity) {
  GaussianCloud cloud;
  cloud.resize(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    cloud.mean[i] = glm::vec3(0, 0, 5.0f + static_cast<float>(i));
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.scale[i] = glm::vec3(1000.0f, 1000.0f, 0.01f);
    cloud.opacity[i] = opacity;
  }
  return cloud;
}

TEST(WorkCount, EndsWhereThePixelsAreFinished) {
  ThreadPool pool(2);
  const Camera camera = make_camera({}, {40, 20}, 50.0f);  // 3x2 tiles, cut at two edges
  // 0.2^n of the light passes n sheets; less than 1e-4 would pass the sixth.
  const WorkCount count = count_work(sheets(10, 0.8f), camera, pool);
  EXPECT_EQ(count.list_entries, 60u);
  EXPECT_EQ(count.reached_entries, 36u);
  EXPECT_EQ(count.warp_evaluations, 6u * 5 * 5);  // boxes of 8x4 in 40x20 pixels
  EXPECT_EQ(count.blended_pairs, 5u * 40 * 20);
}

TEST(WorkCount, LooksThroughWhatIsThin) {
  ThreadPool pool(2);
  const Camera camera = make_camera({}, {16, 16}, 50.0f);
  const WorkCount count = count_work(sheets(10, 0.1f), camera, pool);
  EXPECT_EQ(count.reached_entries, 10u);
  EXPECT_EQ(count.warp_evaluations, 80u);
  EXPECT_EQ(count.blended_pairs, 2560u);
}

TEST(WorkCount, AgreesWithTheCpuCore) {
  ThreadPool pool(2);
  std::vector<test::TestScene> scenes = test::small_scenes();
  test::TestScene many;
  many.name = "many";
  many.cloud = std::make_shared<const GaussianCloud>(test::random_cloud(5000, 0, 3));
  many.request.camera = make_camera({}, {320, 192}, 200.0f);
  scenes.push_back(many);
  for (const test::TestScene& scene : scenes) {
    const auto renderer = make_renderer(scene.cloud, {.kind = RendererKind::cpu, .pool = {}});
    const auto view = renderer.renderer->make_view({.count_pairs = true});
    FrameView frame;
    ASSERT_TRUE(view->render(scene.request, frame).ok()) << scene.name;
    const WorkCount count = count_work(*scene.cloud, scene.request.camera, pool);
    const auto near = [&](std::uint64_t counted, std::uint64_t core, double share) {
      const double slack = 5.0 + share * static_cast<double>(core);
      EXPECT_NEAR(static_cast<double>(counted), static_cast<double>(core), slack) << scene.name;
    };
    // The core lists boxes in one row or column of tiles untested, which adds under 0.4 %, and more
    // for needles. Its slack adds more where everything is smaller than a pixel.
    near(count.list_entries, frame.stats.list_entries, scene.name == "many" ? 0.004 : 0.1);
    near(count.blended_pairs, frame.stats.blended_pairs, 0.001);
    EXPECT_LE(count.reached_entries, count.list_entries) << scene.name;
    EXPECT_GE(32 * count.warp_evaluations, count.blended_pairs) << scene.name;
    EXPECT_LE(count.warp_evaluations, 8 * count.reached_entries) << scene.name;
  }
}

}  // namespace
}  // namespace catgs
