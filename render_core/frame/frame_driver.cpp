#include "render_core/frame/frame_driver.h"

#include <exception>
#include <numeric>

#include "render_core/frame/device_error.h"

namespace catgs {
namespace {

TileGrid grid_of(Pipeline pipeline) {
  return pipeline == Pipeline::catgs ? TileGrid::follows : TileGrid::fixed;
}

/// The depth that FrameGroups::plan() takes for a pipeline.
float planning_depth(Pipeline pipeline, const FrameStats& stats) {
  if (pipeline != Pipeline::catgs) return stats.nearest_depth;
  return stats.mean_inverse_depth > 0.0f ? 1.0f / stats.mean_inverse_depth : 0.0f;
}

}  // namespace

FrameDriver::FrameDriver(const ViewSettings& settings, CatgsWindows catgs)
    : settings_(settings),
      groups_frames_(settings.pipeline == Pipeline::paper ||
                     (settings.pipeline == Pipeline::catgs && catgs == CatgsWindows::some)),
      groups_(settings.speculation, grid_of(settings.pipeline)) {}

RenderStatus FrameDriver::render(const FrameRequest& request, FrameView& frame, const Draw& draw,
                                 const Forget& forget) noexcept {
  if (RenderStatus bad = check_request(request, settings_.format); !bad.ok()) return bad;
  try {
    FramePlan plan = this->plan(request);
    std::optional<FrameView> drawn = draw(plan);
    if (!drawn) {
      groups_.forget();
      --last_group_.frames;
      last_group_.refused = true;
      plan = this->plan(request);
      drawn = draw(plan);
    }
    drawn->stats.kind = plan.kind;
    drawn->stats.window = plan.window;
    if (plan.kind == FrameKind::key) {
      drawn->stats.cut_window = sub_frames_left_ > 0;
      sub_frames_left_ = plan.window;
    } else {
      --sub_frames_left_;
    }
    depth_ = planning_depth(settings_.pipeline, drawn->stats);
    note_time(drawn->stats);
    frame = *drawn;
    return {};
  } catch (const std::exception& error) {
    groups_.forget();
    sub_frames_left_ = 0;
    forget();
    return status_of(error);
  }
}

/// Frames are drawn each for itself in pipelines without groups, with parallel rays, and for two
/// eyes.
FramePlan FrameDriver::plan(const FrameRequest& request) {
  if (!groups_frames_ || request.camera.orthographic || request.stereo) {
    groups_.forget();
    return {.window_end = request.camera};
  }
  const FramePlan plan = groups_.plan(request.camera, request.forecast, depth_);
  if (settings_.pipeline != Pipeline::catgs || !settings_.speculation.where_it_pays) return plan;
  return with_window_if_it_pays(plan, request.camera);
}

/// Groups that do not pay are planned all the same, and drawn without a window. So it is known how
/// long they would last.
FramePlan FrameDriver::with_window_if_it_pays(const FramePlan& plan, const Camera& camera) {
  if (plan.kind == FrameKind::key) {
    const bool pays = gain_.begin_group(last_group_);
    last_group_ = {.window = plan.window > 0 && pays};
  }
  ++last_group_.frames;
  return last_group_.window ? plan : FramePlan{.window_end = camera};
}

void FrameDriver::note_time(const FrameStats& stats) {
  if (settings_.pipeline != Pipeline::catgs) return;
  const float ms = std::accumulate(stats.stage_ms.begin(), stats.stage_ms.end(), 0.0f);
  if (stats.kind == FrameKind::sub) {
    gain_.note_sub(ms);
  } else if (stats.window > 0) {
    gain_.note_key(ms);
  } else {
    gain_.note_plain(ms);
  }
}

}  // namespace catgs
