#pragma once

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/splat.cuh"

namespace catgs::cuda {

/// Finds the Gaussians in view (now, or with `sweeps` at some time of the window), in scene order
/// (so that equal depths blend in scene order): the frustum cache of a key frame.
struct CullParams {
  SceneArrays scene;
  FrameCameras camera;
  bool sweeps;
  FrameShape shape;
  std::uint32_t* mask;     // [cull_words(count)], a bit a Gaussian
  std::uint32_t* before;   // [cull_words(count)], set bits in earlier words
  std::uint32_t* visible;  // [visible_bound], scene indices
  FrameCounts* counts;     // `visible` is set, which may exceed visible_bound
  SortScratch scratch;     // at least cull_scratch_bytes(count)
};

std::uint32_t cull_words(std::uint32_t count);
std::size_t cull_scratch_bytes(std::uint32_t count);
void launch_cull(const CullParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
