// The CUDA core's catgs leaves out what is hidden, and nothing else; needs a device.

#include "tests/render_core/cuda/device.h"

namespace catgs {
namespace {

using test::psnr_db;
using test::render;
using test::render_in;
using test::Rendered;
using test::renderer_of;
using test::TestScene;

/// A wall of opaque Gaussians at z = 4, and many small ones behind it.
TestScene wall_before_many() {
  GaussianCloud cloud = test::random_cloud(30'000, 0, 11);
  const std::size_t behind = cloud.size(), side = 40;
  for (std::size_t i = 0; i < behind; ++i) cloud.mean[i].z = 6.0f + std::abs(cloud.mean[i].z);
  cloud.resize(behind + 2 * side * side, 0);
  for (std::size_t i = 0; i < 2 * side * side; ++i) {
    const std::size_t k = i % (side * side);
    cloud.mean[behind + i] = {0.2f * (static_cast<float>(k % side) - 20.0f),
                              0.2f * (static_cast<float>(k / side) - 20.0f),
                              i < side * side ? 4.0f : 4.1f};
    cloud.scale[behind + i] = glm::vec3(0.2f, 0.2f, 0.01f);
    cloud.rotation[behind + i] = glm::quat(1.0f, 0.0f, 0.0f, 0.0f);
    cloud.opacity[behind + i] = 0.99f;
    cloud.sh[behind + i] = glm::vec3(k % 7 == 0 ? 1.0f : -0.5f);
  }
  TestScene scene;
  scene.cloud = std::make_shared<const GaussianCloud>(std::move(cloud));
  scene.request.camera = make_camera(Pose{}, {320, 192}, 300.0f);
  return scene;
}

TEST(CudaFrames, CatgsDoesNotDrawWhatAWallHides) {
  REQUIRE_DEVICE();
  const TestScene scene = wall_before_many();
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto view = renderer->make_view({.pipeline = Pipeline::catgs});
  const Rendered exact = render(*renderer, scene.request);
  const Rendered first = render_in(*view, scene.request);
  EXPECT_EQ(first.stats.visible, exact.stats.visible);
  for (int frame = 0; frame < 3; ++frame) {
    const Rendered drawn = render_in(*view, scene.request);
    EXPECT_LT(2 * drawn.stats.visible, first.stats.visible);
    EXPECT_GE(psnr_db(drawn.rgb, exact.rgb), 45.0);
  }
  // Beyond the wall, all of them are there at once.
  FrameRequest beyond = scene.request;
  beyond.camera.world_from_camera.position.z = 5.0f;
  const Rendered expected = render(*renderer, beyond), drawn = render_in(*view, beyond);
  EXPECT_EQ(drawn.stats.visible, expected.stats.visible);
  EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 45.0);
}

}  // namespace
}  // namespace catgs
