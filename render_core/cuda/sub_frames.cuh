#pragma once

#include "render_core/cuda/stream.h"
#include "render_core/cuda/tiles.cuh"
#include "render_core/cuda/view_memory.cuh"
#include "render_core/motion/frame_groups.h"

namespace catgs::cuda {

/// The sub-frames of a group, from the lists of its key frame in the memory of a View. All methods
/// but the small ones throw CudaError.
class SubFrames {
 public:
  /// `follows`: whether the grid follows the camera. Then lists are repaired, and may not hold.
  SubFrames(ViewMemory& memory, bool follows) : memory_(memory), follows_(follows) {}

  /// From the first window on, the View has room for windows: ViewSizes::windows.
  void want_room(const FramePlan& plan) { wants_room_ = wants_room_ || plan.window > 0; }
  [[nodiscard]] bool wants_room() const { return wants_room_; }

  /// A key frame is being drawn. Its grid is that of `shape`.
  void begin_group(const FramePlan& plan, const FrameShape& shape, const ListSlack& slack);
  /// Moves the picture to where the next sub-frame has it in the grid.
  void place(const FramePlan& plan, FrameShape& shape) const;
  /// Projects the Gaussians of the group.
  void project(const SceneArrays& scene, const Camera& camera, const FrameShape& shape,
               float min_depth, cudaStream_t stream);
  /// Whether few enough splats have left their lists: always, where the grid is fixed. Repairs the
  /// lists meanwhile. `reach_known`: ViewMemory::reach is that of the last frame.
  [[nodiscard]] bool lists_hold(const FrameShape& shape, bool reach_known, cudaStream_t stream);

  [[nodiscard]] bool follows() const { return follows_; }
  /// BlendParams::loose of the group's frames.
  [[nodiscard]] bool loose() const { return loose_; }

 private:
  ViewMemory& memory_;
  bool follows_;
  Event projected_{cudaEventDisableTiming};  // strays are counted
  bool wants_room_ = false;
  bool loose_ = false;
  glm::ivec2 key_corner_px_{0};  // of the key frame's picture in the grid
  ListSlack slack_;
};

}  // namespace catgs::cuda
