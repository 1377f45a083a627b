// Key frames and sub-frames of the CPU core against its exact pipeline at the same poses.

#include <string>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/renderer.h"
#include "tests/support/camera_moves.h"
#include "tests/support/catgs_view_tests.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::Move;
using test::moved;
using test::moves;
using test::patient_settings;
using test::render_in;
using test::Rendered;
using test::request_on_path;
using test::TestScene;
using test::window;

std::shared_ptr<ThreadPool> pool_of(int threads) { return std::make_shared<ThreadPool>(threads); }

class SubFrames : public testing::TestWithParam<TestScene> {
 protected:
  static std::unique_ptr<Renderer> renderer(int threads = 2, const std::string& simd = "auto") {
    return make_renderer(GetParam().cloud, {RendererKind::cpu, pool_of(threads), simd}).renderer;
  }
};

// Nothing may be missing as long as the camera keeps to the forecast, Gaussians that come through
// the near plane or into the image among it. Measured: 151 dB and more in key frames, which round
// differently from `exact`, and as much in sub-frames, but for one of 101 dB, where two depths that
// are equal by one way of rounding are not by the other.
TEST_P(SubFrames, OnTheForecastPathNothingIsMissing) {
  const TestScene& scene = GetParam();
  for (const std::string_view simd : simd_targets()) {
    const auto core = renderer(2, std::string(simd));
    const auto exact = core->make_view({});
    for (const Move& move : moves()) {
      SCOPED_TRACE(std::string(simd) + " " + move.name);
      const auto view = core->make_view(patient_settings());
      for (int k = 0; k <= window; ++k) {
        const FrameRequest request = request_on_path(scene, move, k);
        const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
        EXPECT_EQ(drawn.stats.kind, k == 0 ? FrameKind::key : FrameKind::sub) << k;
        EXPECT_EQ(drawn.stats.window, window);
        EXPECT_EQ(drawn.stats.overflowed_entries, 0u);
        EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), k == 0 ? 120.0 : 90.0) << "frame " << k;
      }
      EXPECT_EQ(render_in(*view, request_on_path(scene, move, window)).stats.kind, FrameKind::key);
    }
  }
}

TEST_P(SubFrames, ThreadsDoNotChangeTheImage) {
  const Move move = moves().back();
  const auto one = renderer(1), many = renderer(5);
  const auto one_view = one->make_view(patient_settings());
  const auto many_view = many->make_view(patient_settings());
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(GetParam(), move, k);
    EXPECT_EQ(render_in(*one_view, request).rgb, render_in(*many_view, request).rgb);
  }
}

TEST_P(SubFrames, AStillCameraNeedsNoFreshOrder) {
  ViewSettings settings = patient_settings();
  settings.order = BlendOrder::key;
  const auto core = renderer();
  const auto view = core->make_view(settings), exact = core->make_view({});
  for (int k = 0; k <= window; ++k) {
    const FrameRequest request = request_on_path(GetParam(), {}, k);
    EXPECT_GE(test::psnr_db(render_in(*view, request).rgb, render_in(*exact, request).rgb), 120.0)
        << k;
  }
}

INSTANTIATE_TEST_SUITE_P(, SubFrames, testing::ValuesIn(test::small_scenes()),
                         [](const auto& test) { return test.param.name; });

// Gaussians are culled in clusters of neighbours. Here one cluster fills the view and another comes
// in whole, from the side or through the near plane.
TEST(CpuSubFrames, ClustersThatComeIntoViewAreKept) {
  struct Entrance {
    glm::vec3 centre;  // of the cluster that comes in
    Move move;
  };
  const Entrance entrances[] = {{{4.1f, 0, 6.2f}, {"yaw", {0, 0, 0}, {0, 0.2f, 0}}},
                                {{0, 0, -0.05f}, {"back", {0, 0, -0.4f}, {0, 0, 0}}}};
  for (const Entrance& entrance : entrances) {
    SCOPED_TRACE(entrance.move.name);
    GaussianCloud cloud = test::random_cloud(2 * cluster_size, 0, 9);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const glm::vec3 offset = 0.1f * (cloud.mean[i] - glm::vec3(0, 0, 5));
      cloud.mean[i] = offset + (i < cluster_size ? glm::vec3(0, 0, 5) : entrance.centre);
      cloud.scale[i] *= i < cluster_size ? 1.0f : 0.1f;
    }
    TestScene scene;
    scene.cloud = std::make_shared<const GaussianCloud>(std::move(cloud));
    scene.request.camera = make_camera({}, {160, 120}, 150.0f);
    const auto renderer =
        make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
    const auto view = renderer->make_view(patient_settings()), exact = renderer->make_view({});
    std::uint32_t visible_first = 0, visible_last = 0;
    for (int k = 0; k <= window; ++k) {
      const FrameRequest request = request_on_path(scene, entrance.move, k);
      const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
      EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), 80.0) << "frame " << k;
      (k == 0 ? visible_first : visible_last) = expected.stats.visible;
    }
    EXPECT_LE(visible_first, cluster_size);
    EXPECT_GT(visible_last, cluster_size + cluster_size / 2);
  }
}

}  // namespace

namespace test {

INSTANTIATE_TEST_SUITE_P(Cpu, CatgsView, testing::Values(Core{RendererKind::cpu, 120.0, INFINITY}));

}  // namespace test
}  // namespace catgs
