#pragma once

#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/math/camera-inl.h"

namespace catgs::cuda {

/// Cull, project and shade in one pass over the scene. Writes, for the v-th visible Gaussian in
/// scene order (so that equal depths blend in scene order):
struct ProjectParams {
  SceneArrays scene;
  math::CameraModel<float> camera;
  math::CameraModel<double> camera_double;  // view depth is evaluated in double by every core
  FrameShape shape;
  SplatRecord* records;        // [visible_bound]
  std::uint32_t* depth_key;    // [visible_bound], order-preserving bits of the view depth
  std::uint32_t* tile_count;   // [visible_bound], length of its part of the tile lists
  std::uint64_t* block_state;  // [project_blocks(count) + 1], zeroed: ticket, then look-back words
  FrameCounts* counts;         // zeroed; `visible` is set, which may exceed visible_bound
};

std::uint32_t project_blocks(std::uint32_t count);
void launch_project(const ProjectParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
