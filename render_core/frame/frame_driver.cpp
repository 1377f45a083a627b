#include "render_core/frame/frame_driver.h"

#include <exception>

#include "render_core/frame/device_error.h"

namespace catgs {

FrameDriver::FrameDriver(const ViewSettings& settings)
    : settings_(settings), groups_(settings.speculation) {}

RenderStatus FrameDriver::render(const FrameRequest& request, FrameView& frame, const Draw& draw,
                                 const Forget& forget) noexcept {
  if (RenderStatus bad = check_request(request, settings_.format); !bad.ok()) return bad;
  try {
    const FramePlan plan = this->plan(request);
    FrameView drawn = draw(plan);
    drawn.stats.kind = plan.kind;
    drawn.stats.window = plan.window;
    nearest_depth_ = drawn.stats.nearest_depth;
    frame = drawn;
    return {};
  } catch (const std::exception& error) {
    groups_.forget();
    forget();
    return status_of(error);
  }
}

/// Only the paper's pipeline has groups, of perspective pictures. Others are drawn each for itself.
FramePlan FrameDriver::plan(const FrameRequest& request) {
  if (settings_.pipeline != Pipeline::paper || request.camera.orthographic) {
    groups_.forget();
    return {.window_end = request.camera};
  }
  return groups_.plan(request.camera, request.forecast, nearest_depth_);
}

}  // namespace catgs
