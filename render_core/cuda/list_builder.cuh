#pragma once

#include <optional>

#include "render_core/cuda/occlusion.cuh"
#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/cuda/stream.h"
#include "render_core/cuda/tree_cut.h"
#include "render_core/cuda/view_memory.cuh"
#include "render_core/motion/list_culler.h"

namespace catgs::cuda {

/// A frame as the stages that make lists see it.
struct ListRequest {
  /// `corner_px`: of the picture in a grid that follows the camera; nothing: the grid is fixed.
  ListRequest(const Camera& camera, const FramePlan& plan, const SpeculationSettings& settings,
              std::optional<glm::ivec2> corner_px = std::nullopt);

  SceneArrays scene{};
  std::optional<TreeCut> cut{};  // of a scene in pages
  FrameCameras cameras;
  ListCuller culler;
  bool sweeps;      // trails are listed, not ellipses
  float min_depth;  // as in ProjectParams
  ListSlack slack{};
  Occlusion occlusion{};
};

/// How much wider than their paths splats are listed in a group whose grid follows the camera.
ListSlack list_slack(const Camera& camera, const FramePlan& plan);

/// The stages that make the lists of Gaussians per tile, in order, in the memory of a View. All
/// throw CudaError. They only launch work, except that CUB's sorts first wait for a count of an
/// earlier stage. Meanwhile the device works on the stage after that one. `shape` is the same in
/// all stages of a frame.
class ListBuilder {
 public:
  ListBuilder(ViewMemory& memory, int processors) : memory_(memory), processors_(processors) {}

  /// Finds the Gaussians in view. Sets the frame's counts to zero first.
  void cull(const ListRequest& request, const FrameShape& shape, cudaStream_t stream);
  /// Projects and shades them.
  void project(const ListRequest& request, const FrameShape& shape, cudaStream_t stream);
  void sort_by_depth(const FrameShape& shape, cudaStream_t stream);
  void emit(const ListRequest& request, const FrameShape& shape, cudaStream_t stream);
  /// Completes the lists.
  void sort_by_tile(const FrameShape& shape, cudaStream_t stream);

 private:
  [[nodiscard]] SortScratch scratch() const;
  template <class Tile>
  void emit_as(const ListRequest& request, const FrameShape& shape, cudaStream_t stream);
  template <class Tile>
  void sort_as(const FrameShape& shape, cudaStream_t stream);

  ViewMemory& memory_;
  int processors_;
  // Signals the count that the host waits for next. The host polls it: it comes soon, and the
  // device must not run dry. Measured on one H200 with 40 new sessions of fungi_room: 1,200 frames
  // a second, against 1,137 with threads that sleep.
  Event counted_{cudaEventDisableTiming};
  // Set by sort_by_depth().
  std::uint32_t visible_ = 0;
  const std::uint32_t* order_ = nullptr;
};

}  // namespace catgs::cuda
