#pragma once

// What tests of the CUDA core share.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <cuda_runtime_api.h>
#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/frame/renderer.h"
#include "render_core/scene/clusters.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

/// Skips the test where no device is, with the core's own reason.
#define REQUIRE_DEVICE() \
  if (const std::string obstacle = cuda_obstacle(); !obstacle.empty()) GTEST_SKIP() << obstacle

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

/// The scene in the order of its clusters, in which the CUDA core blends equal depths.
inline TestScene in_cluster_order(TestScene scene) {
  ThreadPool pool(2);
  const GaussianCloud& from = *scene.cloud;
  GaussianCloud to;
  to.model = from.model;
  to.resize(from.size(), from.sh_degree);
  std::size_t i = 0;
  for (const std::uint32_t original : morton_order(from.mean, pool)) {
    to.mean[i] = from.mean[original];
    to.rotation[i] = from.rotation[original];
    to.scale[i] = from.scale[original];
    to.opacity[i] = from.opacity[original];
    std::copy_n(from.sh_of(original), from.sh_count(), &to.sh[i * from.sh_count()]);
    ++i;
  }
  scene.cloud = std::make_shared<const GaussianCloud>(std::move(to));
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
