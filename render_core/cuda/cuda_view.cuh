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

/// Room for one kind of things, whose need is known only after a frame: what frames needed before,
/// and a margin. Room that is far too wide for long comes down.
class Room {
 public:
  Room(std::uint64_t first_guess, std::uint64_t limit);

  [[nodiscard]] std::uint32_t size() const { return size_; }
  /// After a key frame: whether it needed more than there is and can be; then the room has grown.
  bool outgrown_by(std::uint32_t needed);
  /// Never more than now, or a part of it.
  void limit_to(double part);

 private:
  [[nodiscard]] std::uint32_t with_margin(std::uint32_t needed) const;

  std::uint32_t limit_, size_;
  std::uint32_t wide_frames_ = 0;  // key frames since half of it was needed
  std::uint32_t most_ = 0;         // needed in these
};

/// How much room the frames of a View get. The host does not wait for counts within a frame: it
/// allots by what frames needed before (not more, since the padding up to a bound is sorted too),
/// and draws a frame again that needed more.
class FrameRoom {
 public:
  /// `list_limit`: most entries of all tile lists.
  FrameRoom(std::uint32_t gaussians, std::uint64_t list_limit, bool splits);

  void apply(FrameShape& shape) const;
  /// After a key frame: whether it lacked room and should be drawn again.
  bool outgrown_by(const FrameCounts& counts);
  /// The device has no memory for this much: less from now on. False when it is little already.
  bool retreat();

 private:
  Room visible_, lists_, slices_;
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
  [[nodiscard]] FrameRoom first_room() const;
  void set_shape(glm::ivec2 size_px);
  void make_room(glm::ivec2 size_px);
  void forget_frames();
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
  Event depth_sorted_;
  FrameShape shape_;
  FrameRoom room_;
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
