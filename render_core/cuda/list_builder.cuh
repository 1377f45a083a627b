#pragma once

#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/cuda/stream.h"
#include "render_core/cuda/view_memory.cuh"
#include "render_core/motion/list_culler.h"

namespace catgs::cuda {

/// What lists have to cover.
struct ListRequest {
  ListRequest(const Camera& camera, const FramePlan& plan, const SpeculationSettings& settings);

  FrameCameras cameras;
  ListCuller culler;
  bool sweeps;      // trails are listed, not ellipses
  float min_depth;  // as in ProjectParams
};

/// The stages that make tile lists, in their order, in the memory of a View. All throw CudaError.
/// They launch; the two sorts wait before for a count of an earlier stage, while the device has the
/// stage after that to do. `shape` is the same in all stages of a frame.
class ListBuilder {
 public:
  ListBuilder(const SceneArrays& scene, ViewMemory& memory, int processors)
      : scene_(scene), memory_(memory), processors_(processors) {}

  /// Finds the Gaussians in view. Sets the frame's counts to zero before.
  void cull(const ListRequest& request, const FrameShape& shape, cudaStream_t stream);
  /// Projects them, and shades those that `colours` does not hold.
  void project(const ListRequest& request, const FrameShape& shape, const ColourArrays& colours,
               cudaStream_t stream);
  void sort_by_depth(const FrameShape& shape, cudaStream_t stream);
  void emit(const ListRequest& request, const FrameShape& shape, cudaStream_t stream);
  /// After this the lists are there.
  void sort_by_tile(const FrameShape& shape, cudaStream_t stream);

 private:
  [[nodiscard]] SortScratch scratch() const;
  template <class Tile>
  void emit_as(const ListRequest& request, const FrameShape& shape, cudaStream_t stream);
  template <class Tile>
  void sort_as(const FrameShape& shape, cudaStream_t stream);

  SceneArrays scene_;
  ViewMemory& memory_;
  int processors_;
  // The count that is waited for next. In a loop: it comes soon, and the device must not run dry
  // (one H200, 40 sessions of fungi_room that have just begun: 1,200 frames a second, with threads
  // that sleep 1,137).
  Event counted_{cudaEventDisableTiming};
  // After sort_by_depth().
  std::uint32_t visible_ = 0;
  const std::uint32_t* order_ = nullptr;
};

}  // namespace catgs::cuda
