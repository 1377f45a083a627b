#pragma once

#include <optional>

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/occlusion.cuh"
#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/cuda/tree_cut.h"
#include "render_core/motion/list_culler.h"

namespace catgs::cuda {

/// Finds the Gaussians in view, in the order of the scene's clusters: the frustum cache of a key
/// frame. In view means now, or with `sweeps` at some time of the window; and not hidden by
/// what is in front. Clusters are tested first, so that the cost of the rest depends on what is in
/// sight, not on the size of the scene.
struct CullParams {
  SceneArrays scene;
  std::optional<TreeCut> cut;  // of a scene in pages
  ListCuller culler;
  FrameCameras camera;
  bool sweeps;
  Occlusion occlusion;
  FrameShape shape;
  std::uint32_t* clusters;  // [count()], those in sight; a cluster's position here is its rank
  std::uint32_t* mask;      // [cull_words(count())], by rank, a bit per Gaussian
  // [count()]. First, of each that is looked at: whether it is in sight. Then, by rank: its number
  // of set bits.
  std::uint32_t* seen;
  std::uint32_t* before;   // [count()], Gaussians in clusters of lower rank
  std::uint32_t* visible;  // [visible_bound], scene indices
  FrameCounts* counts;     // `clusters` is set, `levels` of a tree, and `visible`, which may exceed
                           // visible_bound
  HostCounts* host_counts;  // `visible` is set
  SortScratch scratch;      // at least cull_scratch_bytes(count())
  int processors;           // of the device

  /// Clusters that the frame looks at: all, or those of the tree's pages.
  [[nodiscard]] __host__ __device__ std::uint32_t count() const {
    return cut ? cut->tree.nodes() : scene.cluster_count;
  }
};

std::uint32_t cull_words(std::uint32_t cluster_count);
std::size_t cull_scratch_bytes(std::uint32_t cluster_count);
/// `visible` of both counts must be 0, and `levels`.
void launch_cull(const CullParams& params, cudaStream_t stream);

}  // namespace catgs::cuda
