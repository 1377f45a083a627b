#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Colours of a View's Gaussians from when they were last shaded. Those of a cluster are valid
/// while colours_hold(). Indexed by cluster and Gaussian of the scene, so that they outlast key
/// frames.
struct ColourArrays {
  glm::vec3* shaded_from;  // [cluster_count], position of the camera; null: no cache
  std::uint32_t* known;    // [cluster_count][cluster_size / 32], a bit per Gaussian: `colour` has
                           // its colour
  std::uint32_t* wanted;   // same shape: to be shaded in this frame and stored in `colour`
  PackedColour* colour;    // [count]
};

/// Marks all colours as unknown.
void forget_colours(const ColourArrays& colours, std::uint32_t cluster_count, cudaStream_t stream);

/// Decides which of the visible Gaussians a frame shades: those of clusters whose colours no longer
/// hold, and those that were not visible when their cluster was shaded.
struct WantColoursParams {
  SceneArrays scene;
  glm::vec3 position;             // of the camera, world
  const FrameCounts* counts;      // clusters is read
  const std::uint32_t* clusters;  // as in CullParams
  const std::uint32_t* mask;      // as in CullParams
  ColourArrays colours;
};
void launch_want_colours(const WantColoursParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
