#pragma once

#include <memory>
#include <optional>

#include "render_core/cuda/depth_cells.cuh"
#include "render_core/cuda/device_pages.cuh"
#include "render_core/cuda/frame_room.h"
#include "render_core/cuda/list_builder.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/cuda/split.cuh"
#include "render_core/cuda/stage_times.h"
#include "render_core/cuda/stream.h"
#include "render_core/cuda/sub_frames.cuh"
#include "render_core/cuda/vanilla.cuh"
#include "render_core/cuda/view_memory.cuh"
#include "render_core/frame/frame_driver.h"
#include "render_core/frame/paged_frame.h"
#include "render_core/frame/renderer.h"

namespace catgs::cuda {

class CudaView final : public View {
 public:
  /// Uses the current device, which is `device`. Throws CudaError where it has no memory for a
  /// View.
  CudaView(std::shared_ptr<const DeviceScene> scene, int device, const ViewSettings& settings);

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override;
  [[nodiscard]] std::vector<std::uint32_t> tile_loads() const override;
  [[nodiscard]] std::size_t memory_bytes() const override;
  [[nodiscard]] bool outdated() const override { return paged_ && paged_->outdated(); }

 private:
  void set_shape(glm::ivec2 size_px, const FramePlan& plan, int tile_side);
  void make_room(glm::ivec2 size_px, const FramePlan& plan);
  enum class Headroom { none, some };
  void reserve(Headroom headroom);
  bool needs_more_room();
  void forget_frames();
  [[nodiscard]] std::optional<FrameView> draw(const FrameRequest& request, const FramePlan& plan);
  void draw_key(const FrameRequest& request, const FramePlan& plan);
  [[nodiscard]] bool draw_sub(const FrameRequest& request, const FramePlan& plan);
  void draw_vanilla(const FrameRequest& request);
  [[nodiscard]] SceneArrays scene_arrays() const;
  [[nodiscard]] TreeCut cut_tree(const FrameRequest& request, const FramePlan& plan);
  void note_ends(const Camera& camera);
  [[nodiscard]] Occlusion want_occlusion(const ListRequest& listed, const FramePlan& plan);
  void list_tiles(const ListRequest& request);
  void split(FrameKind kind);
  void blend(const FrameRequest& request);
  void deliver();
  [[nodiscard]] FrameView finished(FrameKind kind, float near_z);

  std::shared_ptr<const DeviceScene> scene_;
  int device_;
  int processors_;
  ViewSettings settings_;
  Stream stream_;
  Event delivered_{cudaEventBlockingSync | cudaEventDisableTiming};  // the frame has arrived
  StageTimes times_;
  FrameDriver driver_;
  std::optional<PagedFrame> paged_;  // of a scene in pages
  FrameShape shape_;
  FrameRoom room_;
  ViewMemory memory_;
  ListBuilder builder_;
  SubFrames sub_frames_;
  VanillaPipeline vanilla_;
  DepthCells depths_;
  int blend_warps_;

  // The contents that memory_ has of the last frame.
  std::optional<FrameShape> reach_of_;  // whose reach is known
  std::optional<LastPicture> ends_of_;  // whose part_ends are known
  float mean_inverse_depth_ = 0.0f;
};

}  // namespace catgs::cuda
