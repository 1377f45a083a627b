#pragma once

#include <functional>

#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/splat.cuh"
#include "render_core/renderer.h"

namespace catgs::cuda {

/// The original 3DGS on the same records, as the baseline that speed-ups are measured against:
/// every Gaussian is tested every frame, a box of three standard deviations decides its tiles, all
/// (tile | depth) keys of 64 bits are sorted, and a block blends a tile, all splats by all pixels.
class VanillaPipeline {
 public:
  struct Frame {
    const SceneArrays* scene;
    CameraPair camera;
    FrameShape shape;  // list_bound: entries beyond it are not drawn
    float3 background;
    float* rgb;           // [height][width][3]
    FrameCounts* counts;  // visible, list_entries and list_max are set; blended_pairs when counted
    bool count_pairs;
  };

  /// Enqueues a frame; `mark` is called after each stage. Waits for the number of list entries, as
  /// the original does, to sort as many. Throws CudaError.
  void draw(const Frame& frame, const std::function<void(Stage)>& mark, cudaStream_t stream);
  /// [tiles], device memory: {first, one past last} list entry of each tile of the last frame.
  [[nodiscard]] const uint2* ranges() const { return range_.get(); }
  [[nodiscard]] std::size_t bytes() const;

 private:
  // Slot = scene index.
  DeviceBuffer<SplatRecord> records_;
  DeviceBuffer<float> depth_;
  DeviceBuffer<ushort4> box_;                      // tiles [x, z) x [y, w)
  DeviceBuffer<std::uint32_t> tile_count_, last_;  // `last_`: inclusive sums
  PinnedBuffer<std::uint32_t> entries_;            // one: the last of `last_`
  DeviceBuffer<std::uint64_t> key_[2];             // by list entry
  DeviceBuffer<std::uint32_t> slot_[2];            // likewise
  DeviceBuffer<uint2> range_;                      // [tiles]
  DeviceBuffer<std::byte> scratch_;
};

}  // namespace catgs::cuda
