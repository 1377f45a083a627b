#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "render_core/cuda/cuda_view.cuh"
#include "render_core/cuda/device_buffer.h"
#include "render_core/frame/renderer.h"
#include "render_core/image/host_image.h"

namespace catgs::cuda {

/// The View of a client that may have two eyes. A frame of one eye is that of a CudaView. For two,
/// each eye has a CudaView, with what it keeps from frame to frame, and their pictures are copied
/// side by side.
class EyeViews final : public View {
 public:
  /// As CudaView().
  EyeViews(std::shared_ptr<const DeviceScene> scene, int device, const ViewSettings& settings);

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override;
  [[nodiscard]] std::vector<std::uint32_t> tile_loads() const override;
  [[nodiscard]] std::size_t memory_bytes() const override;
  [[nodiscard]] bool outdated() const override;

 private:
  RenderStatus render_both(const FrameRequest& request, FrameView& frame);
  [[nodiscard]] FrameView side_by_side(const FrameView& left, const FrameView& right);
  void copy_to_half(const FrameView& of_eye, int left_px);

  std::shared_ptr<const DeviceScene> scene_;
  int device_;
  ViewSettings settings_;
  CudaView left_;
  std::optional<CudaView> right_;      // while frames have two eyes
  HostImage image_;                    // of both eyes, in host memory …
  DeviceBuffer<float> rgb_;            // … or on the device
  std::vector<float> inverse_depths_;  // of both eyes
};

}  // namespace catgs::cuda
