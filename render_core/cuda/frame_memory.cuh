#pragma once

#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/colour_cache.cuh"
#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/reorder.cuh"
#include "render_core/renderer.h"

namespace catgs::cuda {

/// Whether a View has sub-frames, and whether these find their tiles by launch_pixel_runs().
bool speculates(const ViewSettings& settings);
bool turns_tiles(const ViewSettings& settings);

/// Device memory of what a View draws, sized by a FrameShape. Buffers grow between frames.
struct FrameMemory {
  ColourCache colours;
  DeviceBuffer<BlendTask> tasks;
  DeviceBuffer<std::uint32_t> queue, consumed;
  DeviceBuffer<PixelPlace> pixels;
  DeviceBuffer<std::uint32_t> pixel_count;
  DeviceBuffer<uint2> tile_slices;
  DeviceBuffer<ReorderRun> runs;
  DeviceBuffer<std::uint32_t> ordered, giants;
  DeviceBuffer<float> slice_transmittance;
  DeviceBuffer<float4> slice_pixels;
  DeviceBuffer<float> rgb;
  DeviceBuffer<std::uint8_t> i420;
  PinnedBuffer<FrameCounts> host_counts;
  PinnedBuffer<std::byte> host_image;

  /// Makes room; throws CudaError.
  void reserve(const FrameShape& shape, const SceneArrays& scene, const ViewSettings& settings);
  /// The same for the image alone.
  void reserve_image(const FrameShape& shape, const ViewSettings& settings);
  [[nodiscard]] std::size_t bytes() const;
};

}  // namespace catgs::cuda
