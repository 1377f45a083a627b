#pragma once

#include "render_core/cuda/colour_cache.cuh"
#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/giants.cuh"
#include "render_core/cuda/splat.cuh"

namespace catgs::cuda {

/// Projects and shades the Gaussians in view: of a key frame as culling found them, of a sub-frame
/// from the frustum cache. Slot v belongs to Gaussian visible[v].
struct ProjectParams {
  SceneArrays scene;
  FrameCameras camera;
  FrameShape shape;
  float min_depth;            // of splats that counts->displacement, ->nearness speak of
  FrameCounts* counts;        // displacement, nearness, giants, unlisted, depths
  std::uint32_t* visible;     // [visible_bound], scene indices; key frames set watched_bit
  ColourArrays colours;       // what was shaded in earlier frames; all null: nothing
  SplatRecord* records;       // [visible_bound]
  std::uint32_t* depth_key;   // [visible_bound], depth_key() of the view depth
  std::uint32_t* tile_count;  // key frames: [visible_bound], its part of the tile lists
  TileSpans* spans;           // key frames: [visible_bound]
  SplatPath* path;            // key frames with a window: [visible_bound]
  std::uint32_t* order;       // key frames: [visible_bound], as sort_by_depth() wants it
  GiantSet giants{};          // of sub-frames
};

enum class Listing {
  none,      // a sub-frame: its lists are there
  ellipses,  // a key frame without a window
  trails,    // a key frame with one
};
void launch_project(const ProjectParams& params, Listing listing, cudaStream_t stream);

}  // namespace catgs::cuda
