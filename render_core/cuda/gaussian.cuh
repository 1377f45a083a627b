#pragma once

#include <cstdint>

#include "render_core/cuda/device_scene.cuh"
#include "render_core/math/projection-inl.h"

namespace catgs::cuda {

// How kernels read a scene: nobody else knows its layout.

/// What already rules out most Gaussians that nobody sees.
struct Centre {
  math::Vec3<float> mean;  // world
  float log2_opacity;
};

__device__ inline Centre load_centre(const SceneArrays& scene, std::uint32_t i) {
  const float4 word = __ldg(&scene.mean_opacity[i]);
  return {{word.x, word.y, word.z}, word.w};
}

__device__ inline math::CovarianceFactor<float> load_factor(const SceneArrays& scene,
                                                            std::uint32_t i) {
  const float4 a = __ldg(&scene.factor_a[i]);
  const float2 b = __ldg(&scene.factor_b[i]);
  return {a.x, a.y, a.z, a.w, b.x, b.y};
}

}  // namespace catgs::cuda
