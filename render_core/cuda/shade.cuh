#pragma once

#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/math/spherical_harmonics-inl.h"

namespace catgs::cuda {

/// Half coefficients in one 16-byte load.
constexpr int sh_per_word = 8;
constexpr int sh_words = 48 / sh_per_word;

struct ShCoefficients {
  uint4 words[sh_words];
};

/// All loads are issued before the first is used.
__device__ inline ShCoefficients load_sh(const SceneArrays& scene, std::uint32_t i) {
  ShCoefficients sh{};
  const uint4* words = scene.sh + static_cast<std::size_t>(i) * scene.sh_stride;
#pragma unroll
  for (int q = 0; q < sh_words; ++q)
    if (q < scene.sh_stride) sh.words[q] = __ldg(&words[q]);
  return sh;
}

__device__ inline math::Vec3<float> shade(const ShCoefficients& sh, int degree,
                                          const math::Vec3<float>& direction) {
  float basis[16] = {};  // all set: zeros meet the coefficients that the degree leaves out
  math::sh_basis(direction, degree, basis);
  float sum[3] = {0.0f, 0.0f, 0.0f};
#pragma unroll
  for (int q = 0; q < sh_words; ++q) {
    const __half2* pairs = reinterpret_cast<const __half2*>(&sh.words[q]);
#pragma unroll
    for (int j = 0; j < sh_per_word / 2; ++j) {
      const float2 pair = __half22float2(pairs[j]);
      const int at = sh_per_word * q + 2 * j;
      sum[at % 3] += basis[at / 3] * pair.x;
      sum[(at + 1) % 3] += basis[(at + 1) / 3] * pair.y;
    }
  }
  return {math::colour_from_sh_sum(sum[0]), math::colour_from_sh_sum(sum[1]),
          math::colour_from_sh_sum(sum[2])};
}

__device__ inline SplatRecord make_record(float2 centre_px, const math::Whitening<float>& whitening,
                                          float log2_opacity, const math::Vec3<float>& colour) {
  return {centre_px,
          whitening,
          log2_opacity,
          __floats2half2_rn(colour.x, colour.y),
          __float2half_rn(colour.z),
          __float2half_rn(0.0f)};
}

}  // namespace catgs::cuda
