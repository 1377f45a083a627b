#pragma once

#include <cstddef>
#include <cstdint>

#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// What a key frame leaves to its sub-frames: which Gaussians are in view, and the list of every
/// tile. Made by a ListBuilder.
struct TileLists {
  FrameShape shape;
  DeviceBuffer<std::uint32_t> clusters, cull_mask;
  DeviceBuffer<std::uint32_t> visible;  // scene indices; see watched_bit
  DeviceBuffer<uint2> range;
  DeviceBuffer<std::uint32_t> slot;  // front to back within a tile
  DeviceBuffer<FrameCounts> counts;  // and of the frame that was drawn from them last

  /// Makes room; throws CudaError.
  void reserve(const FrameShape& shape, const SceneArrays& scene);
  /// Whether reserve() would not allocate.
  [[nodiscard]] bool has_room(const FrameShape& shape) const;
  [[nodiscard]] std::size_t bytes() const;
};

}  // namespace catgs::cuda
