#pragma once

// What tests of the CUDA core share.

#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/cuda/cuda_renderer.h"
#include "render_core/renderer.h"
#include "tests/support/test_scenes.h"

/// Skips the test where no device is, with the core's own reason.
#define REQUIRE_DEVICE() \
  if (const std::string obstacle = cuda_obstacle(); !obstacle.empty()) GTEST_SKIP() << obstacle

namespace catgs::test {

struct Rendered {
  std::vector<float> rgb;
  FrameStats stats;
};

inline Rendered render_in(View& view, const FrameRequest& request) {
  FrameView frame;
  const RenderStatus status = view.render(request, frame);
  EXPECT_TRUE(status.ok()) << status.message;
  return {status.ok() ? copy_rgb(frame) : std::vector<float>(), frame.stats};
}

inline Rendered render(Renderer& renderer, const FrameRequest& request,
                       const ViewSettings& settings = {}) {
  return render_in(*renderer.make_view(settings), request);
}

inline std::unique_ptr<Renderer> renderer_of(const TestScene& scene, RendererKind kind) {
  return make_renderer(scene.cloud, {.kind = kind, .pool = {}}).renderer;
}

inline TestScene random_scene(std::size_t count) {
  TestScene scene;
  scene.name = "random";
  scene.cloud = std::make_shared<const GaussianCloud>(random_cloud(count, 3, 7));
  scene.request.camera = make_camera(Pose{}, {640, 360}, 400.0f);
  return scene;
}

}  // namespace catgs::test
