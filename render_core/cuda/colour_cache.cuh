#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Colours of a View's Gaussians as they were last shaded: those of a cluster are good while
/// colours_hold(). By cluster and Gaussian of the scene, so that they outlast key frames.
struct ColourArrays {
  glm::vec3* shaded_from;  // [cluster_count], position of the camera; null: there is no cache
  std::uint32_t* known;    // [cluster_count][cluster_size / 32], a bit a Gaussian: is in `colour`
  std::uint32_t* wanted;   // likewise: is to be shaded in this frame, and put there
  PackedColour* colour;    // [count]
};

/// Device memory of a ColourArrays.
struct ColourCache {
  DeviceBuffer<glm::vec3> shaded_from;
  DeviceBuffer<std::uint32_t> known, wanted;
  DeviceBuffer<PackedColour> colour;

  /// Makes room; what is in it means nothing then. Throws CudaError.
  void reserve(const SceneArrays& scene);
  /// Nothing is known.
  void forget(cudaStream_t stream) const;
  [[nodiscard]] ColourArrays arrays() const;
  [[nodiscard]] std::size_t bytes() const;
};

/// Decides which of the visible Gaussians a frame shades: those of clusters that the camera has
/// moved too far beside, and those that were not visible when their cluster was shaded.
struct WantColoursParams {
  SceneArrays scene;
  glm::vec3 position;             // of the camera, world
  const FrameCounts* counts;      // clusters is read
  const std::uint32_t* clusters;  // as in CullParams
  const std::uint32_t* mask;      // likewise
  ColourArrays colours;
};
void launch_want_colours(const WantColoursParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
