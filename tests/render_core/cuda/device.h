#pragma once

// What tests of the CUDA core share.

#include <cstddef>
#include <memory>

#include <cuda_runtime_api.h>
#include <gtest/gtest.h>

#include "render_core/frame/renderer.h"
#include "tests/render_core/cores/core_test.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {

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

/// Takes all memory of the current device but about `left` bytes.
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

}  // namespace catgs::test
