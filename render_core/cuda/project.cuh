#pragma once

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/splat.cuh"

namespace catgs::cuda {

/// Projects and shades the Gaussians in view: for a key frame those found by culling, for a
/// sub-frame those of the frustum cache. Slot v belongs to Gaussian visible[v].
struct ProjectParams {
  SceneArrays scene;
  FrameCameras camera;
  FrameShape shape;
  float min_depth;               // nearer splats do not count in displacement and nearness
  FrameCounts* counts;           // displacement, nearness, depths
  const std::uint32_t* visible;  // [visible_bound], scene indices
  SplatRecord* records;          // [visible_bound]
  std::uint32_t* depth_key;      // [visible_bound], depth_key() of the view depth
  float* splat_depth;            // [visible_bound], the depth itself; null: not wanted
  std::uint32_t* tile_count;     // key frames: [visible_bound], number of its list entries
  TileSpans* spans;              // key frames: [visible_bound]
  SplatPath* path;               // key frames with a window: [visible_bound]
  std::uint32_t* order;          // key frames: [visible_bound], input of sort_by_depth()
};

enum class Listing {
  none,      // a sub-frame: its lists exist already
  ellipses,  // a key frame without a window
  trails,    // a key frame with a window
};
void launch_project(const ProjectParams& params, Listing listing, cudaStream_t stream);

}  // namespace catgs::cuda
