#pragma once

#include <memory>

#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/frame_memory.cuh"
#include "render_core/cuda/splat.cuh"
#include "render_core/cuda/stream.h"
#include "render_core/cuda/vanilla.cuh"
#include "render_core/motion/frame_groups.h"
#include "render_core/renderer.h"

namespace catgs::cuda {

/// How much room lists get. The host does not wait for counts within a frame: it allots by what
/// frames needed before, with a margin since the padding up to a bound is sorted too, and draws a
/// frame again that needed more.
class ListBounds {
 public:
  /// `list_limit`: most entries of all tile lists.
  ListBounds(std::uint32_t gaussians, std::uint64_t list_limit);

  void apply(FrameShape& shape) const;
  /// After a key frame: whether it needed more room than it had and can have; then the bounds have
  /// grown. Bounds that are far too wide for long come down.
  bool outgrown_by(const FrameCounts& counts);

 private:
  std::uint32_t gaussians_;
  std::uint64_t list_limit_;
  std::uint32_t visible_, list_;
  std::uint32_t wide_frames_ = 0;  // key frames since less than half of it was needed
  std::uint32_t most_visible_ = 0, most_list_ = 0;  // in these
};

class CudaView final : public View {
 public:
  CudaView(std::shared_ptr<const DeviceScene> scene, int device, const ViewSettings& settings);

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override;
  [[nodiscard]] std::vector<std::uint32_t> tile_loads() const override;
  [[nodiscard]] std::size_t memory_bytes() const override {
    return memory_.bytes() + vanilla_.bytes();
  }

 private:
  void set_shape(glm::ivec2 size_px);
  void draw_key(const FrameRequest& request, const FramePlan& plan);
  void draw_sub(const FrameRequest& request);
  void draw_vanilla(const FrameRequest& request);
  void list_tiles(const FrameCameras& cameras, bool sweeps, float min_depth);
  void split(uint2* runs);
  void blend(const FrameRequest& request);
  void deliver();
  [[nodiscard]] FrameView finished(const FramePlan& plan);
  [[nodiscard]] std::uint32_t slice_length() const;
  void mark(Stage stage);

  std::shared_ptr<const DeviceScene> scene_;
  int device_;
  ViewSettings settings_;
  Stream stream_;
  Event start_;
  Event after_[stage_count];
  FrameShape shape_;
  ListBounds bounds_;
  FrameMemory memory_;
  VanillaPipeline vanilla_;
  int processors_;
  int blend_warps_;

  // What sub-frames take over.
  FrameGroups groups_;
  std::uint32_t* lists_ = nullptr;  // [list_bound], slots by tile
  bool odd_sub_frame_ = false;
  float nearest_depth_ = 0.0f;
  bool reach_known_ = false;
};

}  // namespace catgs::cuda
