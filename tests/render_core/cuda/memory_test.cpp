// What the CUDA core does where memory is short or nothing is there; needs a device.

#include <cstddef>

#include <gtest/gtest.h>

#include "tests/render_core/cuda/device.h"
#include "tests/support/camera_moves.h"

namespace catgs {
namespace {

using test::Hog;
using test::random_scene;
using test::render;
using test::render_in;
using test::renderer_of;
using test::TestScene;
using CudaMemory = test::CoreTest;

TEST_F(CudaMemory, BoundedListsKeepTheNearestAndCountTheRest) {
  const TestScene scene = random_scene(50'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto whole = render(*renderer, scene.request);
  const std::uint64_t room = whole.stats.list_entries / 2;
  const auto cut = render(*renderer, scene.request, {.max_list_entries = room});
  EXPECT_EQ(cut.stats.list_entries, room);
  EXPECT_EQ(cut.stats.overflowed_entries, whole.stats.list_entries - room);
  EXPECT_EQ(cut.stats.visible, whole.stats.visible);
  // What is nearest covers most of the rest.
  EXPECT_GT(test::psnr_db(cut.rgb, whole.rgb), 15.0);
}

// Lists that find no memory are cut, counted, and grow no more; frames continue.
TEST_F(CudaMemory, ListsThatTheDeviceCannotHoldAreCut) {
  const TestScene scene = random_scene(400'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const auto view = renderer->make_view({});
  FrameRequest close = scene.request;
  close.camera = make_camera(Pose{}, {1920, 1080}, 9000.0f);
  test::Rendered cut;
  {
    const Hog hog(std::size_t{160} << 20);
    for (int frame = 0; frame < 3; ++frame) cut = render_in(*view, close);
  }
  EXPECT_GT(cut.stats.overflowed_entries, 0u);
  const auto expected =
      render(*renderer, close, {.max_list_entries = cut.stats.list_entries, .split_tasks = false});
  EXPECT_EQ(cut.stats.visible, expected.stats.visible);
  EXPECT_GE(test::psnr_db(cut.rgb, expected.rgb), 60.0);
}

// Nor do sub-frames follow a key frame that failed. The picture of that one alone is larger than
// all that the View could give back, so that no retreat makes room for it.
TEST_F(CudaMemory, AViewOutlivesAFrameThatFoundNone) {
  TestScene scene = random_scene(5'000);
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  const test::Move move = test::moves().front();
  const auto view = renderer->make_view(test::patient_settings());
  (void)render_in(*view, test::request_on_path(scene, move, 0));
  scene.request.camera = make_camera(Pose{}, {7680, 4320}, 4800.0f);
  constexpr std::size_t picture_bytes = std::size_t{7680} * 4320 * 3 * sizeof(float);
  constexpr std::size_t left = std::size_t{4} << 20;
  ASSERT_LT(left + 2 * view->memory_bytes(), picture_bytes);  // twice: blocks are rounded up
  {
    const Hog hog(left);
    FrameView frame;
    const RenderStatus status = view->render(test::request_on_path(scene, move, 0), frame);
    EXPECT_EQ(status.code, RenderStatus::Code::out_of_memory) << status.message;
    EXPECT_TRUE(view->tile_loads().empty());
  }
  const FrameRequest next = test::request_on_path(scene, move, 1);
  const auto drawn = render_in(*view, next);
  EXPECT_EQ(drawn.stats.kind, FrameKind::key);
  EXPECT_GE(test::psnr_db(drawn.rgb, render(*renderer, next).rgb), 60.0);
}

TEST_F(CudaMemory, AnEmptySceneStaysOne) {
  TestScene scene;
  scene.cloud = std::make_shared<const GaussianCloud>();
  scene.request.camera = make_camera(Pose{}, {64, 48}, 50.0f);
  scene.request.background = {0.25f, 0.5f, 1.0f};
  const auto renderer = renderer_of(scene, RendererKind::cuda);
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::vanilla, Pipeline::catgs}) {
    const auto view = renderer->make_view({.pipeline = pipeline});
    for (int frame = 0; frame < 1300; ++frame) {  // room is looked over meanwhile
      const auto drawn = render_in(*view, scene.request);
      ASSERT_FALSE(HasFailure()) << frame;
      ASSERT_FLOAT_EQ(drawn.rgb[1], 0.5f);
    }
  }
}

}  // namespace
}  // namespace catgs
