#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Blends every tile's list front to back into the float image.
struct BlendParams {
  FrameShape shape;
  const SplatRecord* records;
  const std::uint32_t* slot;  // [list_bound], sorted by tile, front to back within one
  const uint2* range;         // [tiles]
  float3 background;
  float* rgb;           // [height][width][3], display-referred, in [0, 1]
  FrameCounts* counts;  // list_max is set, and blended_pairs when they are counted
  bool count_pairs;     // slower
};
void launch_blend(const BlendParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
