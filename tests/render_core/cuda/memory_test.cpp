// What the CUDA core does where memory is short or nothing is there; needs a device.

#include <cstddef>

#include <cuda_runtime_api.h>
#include <gtest/gtest.h>

#include "tests/render_core/cuda/device.h"

namespace catgs {
namespace {

using test::random_scene;
using test::render;
using test::render_in;
using test::renderer_of;
using test::TestScene;

/// Takes all device memory but about `left` bytes.
class Hog {
 public:
  explicit Hog(std::size_t left) {
    std::size_t free = 0, total = 0;
    EXPECT_EQ(cudaMemGetInfo(&free, &total), cudaSuccess);
    EXPECT_GT(free, left);
    EXPECT_EQ(cudaMalloc(&memory_, free - left), cudaSuccess);
  }
  ~Hog() { (void)cudaFree(memory_); }
  Hog(const Hog&) = delete;
  Hog& operator=(const Hog&) = delete;

 private:
  void* memory_ = nullptr;
};

TEST(CudaMemory, ShortMemoryIsCountedNeverOverrun) {
  REQUIRE_DEVICE();
  const TestScene scene = random_scene(50'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto whole = render(*renderer, scene.request);
  const std::uint64_t room = whole.stats.list_entries / 2;
  const auto cut = render(*renderer, scene.request, {.max_list_entries = room});
  EXPECT_EQ(cut.stats.overflowed_entries, whole.stats.list_entries - room);
  EXPECT_EQ(cut.rgb.size(), whole.rgb.size());
}

// Lists that find no memory are cut, counted, and grow no more; frames go on.
TEST(CudaMemory, ListsThatTheDeviceCannotHoldAreCut) {
  REQUIRE_DEVICE();
  TestScene scene = random_scene(400'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto view = renderer->make_view({});
  (void)render_in(*view, scene.request);
  const Hog hog(std::size_t{96} << 20);
  FrameRequest close = scene.request;
  close.camera = make_camera(Pose{}, {1920, 1080}, 9000.0f);
  for (int frame = 0; frame < 3; ++frame) {
    const auto cut = render_in(*view, close);
    EXPECT_GT(cut.stats.overflowed_entries, 0u);
    EXPECT_GT(cut.stats.list_entries, 0u);
  }
}

TEST(CudaMemory, AViewOutlivesAFrameThatFoundNone) {
  REQUIRE_DEVICE();
  const TestScene scene = random_scene(50'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto whole = render(*renderer, scene.request);
  const auto view = renderer->make_view({.pipeline = Pipeline::catgs});
  {
    const Hog hog(std::size_t{4} << 20);
    FrameView frame;
    const RenderStatus status = view->render(scene.request, frame);
    EXPECT_EQ(status.code, RenderStatus::Code::out_of_memory) << status.message;
    EXPECT_TRUE(view->tile_loads().empty());
  }
  EXPECT_GE(test::psnr_db(render_in(*view, scene.request).rgb, whole.rgb), 60.0);
}

TEST(CudaMemory, AnEmptySceneStaysOne) {
  REQUIRE_DEVICE();
  TestScene scene;
  scene.cloud = std::make_shared<const GaussianCloud>();
  scene.request.camera = make_camera(Pose{}, {64, 48}, 50.0f);
  scene.request.background = {0.25f, 0.5f, 1.0f};
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::vanilla, Pipeline::catgs}) {
    const auto view = renderer->make_view({.pipeline = pipeline});
    for (int frame = 0; frame < 1300; ++frame) {  // room that is not needed comes down meanwhile
      const auto drawn = render_in(*view, scene.request);
      ASSERT_FALSE(HasFailure()) << frame;
      ASSERT_FLOAT_EQ(drawn.rgb[1], 0.5f);
    }
  }
}

}  // namespace
}  // namespace catgs
