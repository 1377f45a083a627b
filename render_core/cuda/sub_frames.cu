#include <cstddef>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/group_grid.h"
#include "render_core/cuda/list_repair.cuh"
#include "render_core/cuda/project.cuh"
#include "render_core/cuda/sub_frames.cuh"

namespace catgs::cuda {

void SubFrames::begin_group(const FramePlan& plan, const FrameShape& shape,
                            const ListSlack& slack) {
  loose_ = follows_ && plan.window > 0;
  key_corner_px_ = {shape.left_px, shape.top_px};
  slack_ = slack;
}

void SubFrames::place(const FramePlan& plan, FrameShape& shape) const {
  const glm::ivec2 corner = corner_px(key_corner_px_, plan);
  shape.left_px = corner.x;
  shape.top_px = corner.y;
}

void SubFrames::project(const SceneArrays& scene, const Camera& camera, const FrameShape& shape,
                        float min_depth, cudaStream_t stream) {
  const ViewMemory& m = memory_;
  constexpr std::size_t kept = offsetof(FrameCounts, nearness);
  check(cudaMemsetAsync(reinterpret_cast<std::byte*>(m.counts.get()) + kept, 0,
                        sizeof(FrameCounts) - kept, stream),
        "counts");
  m.list_counts.get()->strays = 0;
  const CameraPair now = in_grid(make_camera_pair(camera), {shape.left_px, shape.top_px});
  launch_project({.scene = scene,
                  .camera = {.now = now, .end = now.single, .near_z = camera.near_z},
                  .shape = shape,
                  .min_depth = min_depth,
                  .counts = m.counts.get(),
                  .visible = m.visible.get(),
                  .records = m.records.get(),
                  .depth_key = m.depth.get(),
                  .splat_depth = m.splat_depth.get(),
                  .tile_count = nullptr,
                  .spans = nullptr,
                  .path = follows_ ? m.path.get() : nullptr,
                  .slack = slack_,
                  .order = nullptr,
                  .host_counts = m.list_counts.get()},
                 Listing::none, stream);
  check(cudaEventRecord(projected_.get(), stream), "strays");
}

bool SubFrames::lists_hold(const FrameShape& shape, bool reach_known, cudaStream_t stream) {
  if (!follows_) return true;
  const ViewMemory& m = memory_;
  launch_list_repair({.shape = shape,
                      .range = m.range.get(),
                      .reach = reach_known ? m.reach.get() : nullptr,
                      .splat_depth = m.splat_depth.get(),
                      .entries = m.entries.get()},
                     stream);
  check(cudaEventSynchronize(projected_.get()), "strays");
  if (m.list_counts.get()->strays <= most_strays) return true;
  check(cudaStreamSynchronize(stream), "repair");  // the key frame may move its memory
  return false;
}

}  // namespace catgs::cuda
