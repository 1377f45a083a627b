#pragma once

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/gaussian.cuh"
#include "render_core/math/spherical_harmonics-inl.h"

namespace catgs::cuda {

struct ShCoefficients {
  float base[3];  // RGB
  static constexpr int words = (packed_sh_bytes(max_sh_degree) + 3) / 4;
  std::uint32_t higher[words];  // four harmonics each, coefficient-major RGB
  float unit[max_sh_degree];    // PackedUnits::sh in the Gaussian's octave
};

/// Loads the planes of a record from byte `at` on.
template <int degree, int at>
__device__ void load_planes(const SceneArrays& scene, std::uint32_t i,
                            std::uint32_t (&words)[ShCoefficients::words]) {
  if constexpr (at < packed_record_bytes(degree)) {
    constexpr int width = packed_plane_width(degree, at);
    static_assert(width != 2, "no degree leaves two bytes");
    constexpr int w = (at - static_cast<int>(sizeof(PackedGeometry))) / 4;
    const std::byte* from = block_of(scene, i) + packed_offset(at, width, i % cluster_size);
    if constexpr (width == 16) {
      const uint4 four = __ldg(reinterpret_cast<const uint4*>(from));
      words[w] = four.x, words[w + 1] = four.y, words[w + 2] = four.z, words[w + 3] = four.w;
    } else if constexpr (width == 8) {
      const uint2 two = __ldg(reinterpret_cast<const uint2*>(from));
      words[w] = two.x, words[w + 1] = two.y;
    } else if constexpr (width == 4) {
      words[w] = __ldg(reinterpret_cast<const std::uint32_t*>(from));
    } else {
      words[w] = __ldg(reinterpret_cast<const std::uint8_t*>(from));
    }
    load_planes<degree, at + width>(scene, i, words);
  }
}

/// All loads are issued before the first is used.
__device__ inline ShCoefficients load_sh(const SceneArrays& scene, std::uint32_t i) {
  constexpr int first = sizeof(PackedGeometry);
  ShCoefficients sh{};
  const uint4 a = load_geometry(scene, i, 0), b = load_geometry(scene, i, 16);
  sh.base[0] = high_half(a.w), sh.base[1] = low_half(b.w), sh.base[2] = high_half(b.w);
  switch (scene.sh_degree) {
    case 1:
      load_planes<1, first>(scene, i, sh.higher);
      break;
    case 2:
      load_planes<2, first>(scene, i, sh.higher);
      break;
    case 3:
      load_planes<3, first>(scene, i, sh.higher);
      break;
    default:
      break;
  }
  const float4 units = __ldg(reinterpret_cast<const float4*>(&scene.units[i / cluster_size]));
  const float octave = packed_sh_octave(a.w);
  sh.unit[0] = octave * units.y, sh.unit[1] = octave * units.z, sh.unit[2] = octave * units.w;
  return sh;
}

__device__ inline math::Vec3<float> shade(const ShCoefficients& sh, int degree,
                                          const math::Vec3<float>& direction) {
  float basis[16] = {};  // all set, because zeros are multiplied by coefficients that the degree
                         // leaves out
  math::sh_basis(direction, degree, basis);
  float sum[3] = {basis[0] * sh.base[0], basis[0] * sh.base[1], basis[0] * sh.base[2]};
#pragma unroll
  for (int k = 1; k < 16; ++k) {
    const float weight = basis[k] * sh.unit[sh_degree_of(k) - 1];
#pragma unroll
    for (int channel = 0; channel < 3; ++channel) {
      const int at = 3 * (k - 1) + channel;
      sum[channel] += weight * packed_sh(sh.higher[at / 4], at % 4);
    }
  }
  return {math::colour_from_sh_sum(sum[0]), math::colour_from_sh_sum(sum[1]),
          math::colour_from_sh_sum(sum[2])};
}

/// What is too large for a half is clamped, because infinity times a weight of zero is NaN. No
/// picture is as large.
__device__ inline PackedColour pack(const math::Vec3<float>& colour, float half_side_px) {
  constexpr float most = 65504.0f;
  return {__floats2half2_rn(fminf(colour.x, most), fminf(colour.y, most)),
          __float2half_rn(fminf(colour.z, most)), __float2half_ru(fminf(half_side_px, most))};
}

}  // namespace catgs::cuda
