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
  // [visible_bound]. Key frames with a window set it. In sub-frames of catgs, it tells splats that
  // their lists may miss: strays. Null in all other frames.
  SplatPath* path;
  ListSlack slack;          // of paths
  std::uint32_t* order;     // key frames: [visible_bound], input of sort_by_depth()
  HostCounts* host_counts;  // sub-frames with paths: strays are added
};

/// A splat strays when it is farther outside of its lists than this, px. What it shows at its rim
/// is faint. With 3 px, blocks of 16x16 px fell to 25 dB.
constexpr float stray_px = 0.5f;
/// A sub-frame that misses no more than so many splats is drawn. A room has a million in view, and
/// some near ones leave any path.
constexpr std::uint32_t most_strays = 50;

enum class Listing {
  none,      // a sub-frame: its lists exist already
  ellipses,  // a key frame without a window
  trails,    // a key frame with a window
};
void launch_project(const ProjectParams& params, Listing listing, cudaStream_t stream);

}  // namespace catgs::cuda
