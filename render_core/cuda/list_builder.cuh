#pragma once

#include "render_core/cuda/colour_cache.cuh"
#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/cuda/stream.h"
#include "render_core/cuda/tile_lists.cuh"
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

/// The stages that make tile lists, in their order, and their memory. All throw CudaError. They
/// launch; the two sorts wait before for a count of an earlier stage, while the device has the
/// stage after that to do.
class ListBuilder {
 public:
  ListBuilder(const SceneArrays& scene, int processors) : scene_(scene), processors_(processors) {}

  void reserve(const FrameShape& shape, bool sweeps);
  void release() { memory_ = {}; }
  [[nodiscard]] std::size_t bytes() const;

  /// Finds the Gaussians in view. Sets the counts of `lists` to zero before.
  void cull(const ListRequest& request, TileLists& lists, cudaStream_t stream);
  /// Projects them, and shades those that `colours` does not hold.
  void project(const ListRequest& request, TileLists& lists, const ColourArrays& colours,
               cudaStream_t stream);
  void sort_by_depth(const TileLists& lists, cudaStream_t stream);
  void emit(const ListRequest& request, TileLists& lists, cudaStream_t stream);
  /// After this the lists are there.
  void sort_by_tile(TileLists& lists, cudaStream_t stream);

  /// Of the Gaussians in view, as project() left them.
  [[nodiscard]] SplatRecord* records() const { return memory_.records.get(); }
  /// Room for as many depth keys as there are records.
  [[nodiscard]] std::uint32_t* depth_keys() const { return memory_.depth[0].get(); }

 private:
  struct Memory {
    DeviceBuffer<std::uint32_t> cull_seen, cull_before;
    DeviceBuffer<SplatRecord> records;
    DeviceBuffer<TileSpans> spans;
    DeviceBuffer<SplatPath> path;
    DeviceBuffer<std::uint32_t> tile_count, first;
    DeviceBuffer<std::uint32_t> depth[2], order[2];
    DeviceBuffer<std::uint32_t> tile[2], slot;
    DeviceBuffer<std::byte> scratch;
    PinnedBuffer<HostCounts> counts;
  };

  [[nodiscard]] SortScratch scratch() const;
  template <class Tile>
  void emit_as(const ListRequest& request, TileLists& lists, cudaStream_t stream);
  template <class Tile>
  void sort_as(TileLists& lists, cudaStream_t stream);

  SceneArrays scene_;
  int processors_;
  // The count that is waited for next. In a loop: it comes soon, and the device must not run dry
  // (one H200, 40 sessions of fungi_room that have just begun: 1,200 frames a second, with threads
  // that sleep 1,137).
  Event counted_{cudaEventDisableTiming};
  Memory memory_;
  // After sort_by_depth().
  std::uint32_t visible_ = 0;
  const std::uint32_t* order_ = nullptr;
};

}  // namespace catgs::cuda
