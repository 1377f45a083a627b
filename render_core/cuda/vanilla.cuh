#pragma once

#include <algorithm>
#include <functional>

#include "render_core/cuda/memory_table.h"
#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/frame/renderer.h"

namespace catgs::cuda {

/// The sizes that the rows of VanillaMemory depend on.
struct VanillaSizes {
  std::uint32_t gaussians;  // of the scene
  std::uint32_t entries;    // of all tile lists
  FrameShape shape;
};

struct VanillaMemory : MemoryTable<VanillaSizes> {
  using S = const VanillaSizes&;

  // Slot = scene index.
  DeviceRow<SplatRecord> records{this, Life::frame, [](S s) { return s.gaussians; }};
  DeviceRow<float> depth{this, Life::frame, [](S s) { return s.gaussians; }};
  // Tiles [x, z) x [y, w).
  DeviceRow<ushort4> box{this, Life::frame, [](S s) { return s.gaussians; }};
  DeviceRow<std::uint32_t> tile_count{this, Life::frame, [](S s) { return s.gaussians; }};
  DeviceRow<std::uint32_t> last{this, Life::frame, [](S s) { return s.gaussians; }};  // their sums
  PinnedRow<std::uint32_t> entries{this, Life::frame, [](S) { return 1; }};  // the last of `last`
  // By list entry. The sort may leave its result in the row or in its `other` one.
  DeviceRow<std::uint64_t> key{this, Life::frame, [](S s) { return s.entries; }};
  DeviceRow<std::uint64_t> other_key{this, Life::frame, [](S s) { return s.entries; }};
  DeviceRow<std::uint32_t> slot{this, Life::frame, [](S s) { return s.entries; }};
  DeviceRow<std::uint32_t> other_slot{this, Life::frame, [](S s) { return s.entries; }};
  DeviceRow<uint2> range{this, Life::frame, [](S s) { return s.shape.tiles(); }};
  DeviceRow<std::byte> scratch{this, Life::frame, [](S s) {
                                 return std::max(sum_scratch_bytes(s.gaussians),
                                                 key_sort_scratch_bytes(s.entries, s.shape));
                               }};
};

/// The original 3DGS on the same records, as the baseline of speed-ups. Every Gaussian is tested
/// every frame. A box of three standard deviations decides its tiles. All (tile | depth) keys of 64
/// bits are sorted, and a block blends a tile, all splats by all pixels.
class VanillaPipeline {
 public:
  struct Frame {
    const SceneArrays* scene;
    CameraPair camera;
    FrameShape shape;  // entries beyond list_bound are not drawn
    float3 background;
    float* rgb;           // [height][width][3]
    FrameCounts* counts;  // visible, list_entries and list_max are set; blended_pairs when counted
    bool count_pairs;
  };

  /// Enqueues a frame; `mark` is called after each stage. Like the original, it waits for the
  /// number of list entries and sorts exactly as many. Throws CudaError.
  void draw(const Frame& frame, const std::function<void(Stage)>& mark, cudaStream_t stream);
  /// [tiles], device memory: {first, one past last} list entry of each tile of the last frame.
  [[nodiscard]] const uint2* ranges() const { return memory_.range.get(); }
  [[nodiscard]] std::size_t bytes() const { return memory_.bytes(); }

 private:
  void project(const Frame& frame, cudaStream_t stream);
  [[nodiscard]] std::uint32_t count_entries(const Frame& frame, cudaStream_t stream);

  VanillaMemory memory_;
};

}  // namespace catgs::cuda
