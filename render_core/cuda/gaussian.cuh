#pragma once

#include <cstdint>

#include "render_core/cuda/device_scene.cuh"
#include "render_core/math/fade-inl.h"
#include "render_core/math/projection-inl.h"

namespace catgs::cuda {

// How kernels read a scene. No other code knows its layout.

__device__ inline const std::byte* block_of(const SceneArrays& scene, std::uint32_t i) {
  const auto c = static_cast<std::uint32_t>(i / cluster_size);
  const std::uint32_t in_chunk = c & ((1u << scene.chunk_shift) - 1u);
  return scene.blocks + std::size_t{c >> scene.chunk_shift} * scene.chunk_bytes +
         std::size_t{in_chunk} * scene.block_bytes;
}

/// Word `at` of the record of Gaussian i; at = 0 or 16, parts of its PackedGeometry.
__device__ inline uint4 load_geometry(const SceneArrays& scene, std::uint32_t i, int at) {
  const std::byte* word = block_of(scene, i) + packed_offset(at, sizeof(uint4), i % cluster_size);
  return __ldg(reinterpret_cast<const uint4*>(word));
}

__device__ inline float low_half(std::uint32_t word) {
  return from_half(static_cast<std::uint16_t>(word & 0xffffu));
}
__device__ inline float high_half(std::uint32_t word) {
  return from_half(static_cast<std::uint16_t>(word >> 16));
}

/// The data that rules out most invisible Gaussians.
struct Centre {
  math::Vec3<float> mean;  // world
  float log2_opacity;
};

__device__ inline Centre load_centre(const SceneArrays& scene, std::uint32_t i) {
  const uint4 word = load_geometry(scene, i, 0);
  float log2_opacity = unpack_log2_opacity(word.w & 0xffffu);
  if (scene.share != nullptr) {
    const float share = scene.share[i / cluster_size];
    if (share < 1.0f) log2_opacity = math::faded_log2_opacity(log2_opacity, share);
  }
  return {{__uint_as_float(word.x), __uint_as_float(word.y), __uint_as_float(word.z)},
          log2_opacity};
}

__device__ inline math::CovarianceFactor<float> load_factor(const SceneArrays& scene,
                                                            std::uint32_t i) {
  const float unit = __ldg(&scene.units[i / cluster_size].factor);
  const uint4 word = load_geometry(scene, i, 16);
  return unpack_factor({word.x, word.y, word.z}, unit);
}

}  // namespace catgs::cuda
