#include "render_core/frame_driver.h"

#include <cassert>
#include <exception>

#include "render_core/device_error.h"

namespace catgs {

FrameDriver::FrameDriver(const ViewSettings& settings)
    : settings_(settings), groups_(settings.speculation) {}

RenderStatus FrameDriver::render(const FrameRequest& request, FrameView& frame, const Draw& draw,
                                 const Forget& forget) noexcept {
  if (RenderStatus bad = check_request(request, settings_.format); !bad.ok()) return bad;
  try {
    FramePlan plan = this->plan(request);
    std::optional<FrameView> drawn = draw(plan);
    if (!drawn) {
      assert(plan.kind == FrameKind::sub);
      // The key frame that replaces the sub-frame gets no window. Where this happens to frame after
      // frame, none is drawn in vain.
      groups_.forget();
      plan = groups_.plan(request.camera, std::nullopt, depths_);
      drawn = draw(plan);
      assert(drawn);
    }
    drawn->stats.kind = plan.kind;
    drawn->stats.window = plan.window;
    depths_ = {drawn->stats.nearest_depth, drawn->stats.mean_inverse_depth};
    if (settings_.speculation.cost_aware)
      costs_.note(plan.kind, plan.window, drawn->stats.total_ms());
    frame = *drawn;
    return {};
  } catch (const std::exception& error) {
    groups_.forget();
    costs_.forget();
    forget();
    return status_of(error);
  }
}

/// Pipelines without caches list for the picture of the frame alone.
FramePlan FrameDriver::plan(const FrameRequest& request) {
  const Camera& camera = request.camera;
  if (keeps_caches(settings_.pipeline))
    return groups_.plan(camera, costs_.pays() ? request.forecast : std::nullopt, depths_);
  FramePlan plan;
  plan.window_end = camera;
  plan.grid = image_grid(camera.size_px);
  plan.list_near_z = camera.near_z;
  return plan;
}

}  // namespace catgs
