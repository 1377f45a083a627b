#pragma once

#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/renderer.h"

namespace catgs::cuda {

/// All device memory of a View, sized by a FrameShape. Buffers only grow, between frames.
struct FrameMemory {
  DeviceBuffer<SplatRecord> records;
  DeviceBuffer<std::uint32_t> tile_count, first;
  DeviceBuffer<std::uint32_t> depth[2], order[2];
  DeviceBuffer<std::uint32_t> tile[2], slot[2];
  DeviceBuffer<uint2> range;
  DeviceBuffer<std::uint64_t> block_state;
  DeviceBuffer<FrameCounts> counts;
  DeviceBuffer<std::byte> scratch;
  DeviceBuffer<float> rgb;
  DeviceBuffer<std::uint8_t> i420;
  PinnedBuffer<FrameCounts> host_counts;
  PinnedBuffer<std::byte> host_image;

  /// Makes room; throws CudaError. `scene_blocks` words of look-back state.
  void reserve(const FrameShape& shape, std::size_t scene_blocks, const ViewSettings& settings);
  [[nodiscard]] std::size_t bytes() const;
};

}  // namespace catgs::cuda
