#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/frame/renderer.h"
#include "render_core/math/camera.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs::first_sight {

/// Measures of a small picture of a view, each in 0…1.
struct Judgement {
  float coverage = 0.0f;  // mean of the light that the scene stops
  float detail = 0.0f;    // mean difference of neighbouring pixels in colour
  float veil = 0.0f;      // mean of the picture that changes without what is near the camera
  float spread = 0.0f;    // how much of the picture the detail covers
  float symmetry = 0.0f;  // between the left and the right half
};

/// Draws small pictures of a scene with the CPU core, from a sample of its Gaussians.
class ViewJudge {
 public:
  /// Each Gaussian stands for `stands_for` of the scene. `core`: the bounds of most of it.
  ViewJudge(const GaussianCloud& cloud, float stands_for, const Bounds& core,
            std::shared_ptr<ThreadPool> pool);

  /// `near` (world units): what is nearer than that in front of the camera is a veil. That takes a
  /// second picture. It is not drawn, and all is veil, unless `wanted` is true without one.
  Judgement judge(const Pose& pose, float near,
                  const std::function<bool(const Judgement& unveiled)>& wanted);

 private:
  void draw(const Pose& pose, float near_z, std::vector<glm::vec3>& pixels);

  std::unique_ptr<Renderer> renderer_;
  std::unique_ptr<View> view_;
  std::vector<glm::vec3> picture_, without_near_;
};

}  // namespace catgs::first_sight
