#pragma once

#include <cstdint>

#include "render_core/cuda/device_buffer.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs::cuda {

/// What kernels see of a scene; N = count. Pointers are device memory. Harmonics are half
/// precision: they are most of a scene's bytes, and their rounding alone leaves 75 dB.
struct SceneArrays {
  std::uint32_t count = 0;
  int sh_degree = 0;
  int sh_stride = 0;                     // uint4 per Gaussian in `sh`
  const float4* mean_opacity = nullptr;  // mean (world), log2 of the opacity
  const float4* factor_a = nullptr;      // covariance factor xx, yx, yy, zx
  const float2* factor_b = nullptr;      // covariance factor zy, zz
  const uint4* sh = nullptr;             // 3 K halfs, coefficient-major RGB, padded with zeros
};

/// One scene on one device, shared by all Views.
class DeviceScene {
 public:
  explicit DeviceScene(const GaussianCloud& cloud);

  [[nodiscard]] const SceneArrays& arrays() const { return arrays_; }
  [[nodiscard]] std::size_t bytes() const {
    return mean_opacity_.bytes() + factor_a_.bytes() + factor_b_.bytes() + sh_.bytes();
  }

 private:
  DeviceBuffer<float4> mean_opacity_;
  DeviceBuffer<float4> factor_a_;
  DeviceBuffer<float2> factor_b_;
  DeviceBuffer<uint4> sh_;
  SceneArrays arrays_;
};

}  // namespace catgs::cuda
