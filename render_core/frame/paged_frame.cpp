#include "render_core/frame/paged_frame.h"

#include <utility>

#include "render_core/base/error.h"

namespace catgs {

PagedFrame::PagedFrame(PagedTree& tree, const ViewSettings& settings)
    : tree_(tree), watch_(tree.watch()) {
  if (settings.pipeline == Pipeline::vanilla)
    throw InputError("--pipeline vanilla", "", "draws whole scenes only, not parts of a tree",
                     "leave --detail and --scene-memory out");
}

void PagedFrame::begin(const FrameRequest& request, const FramePlan& plan) {
  keeps_pages_ = plan.window > 0;
  cameras_ = cameras_of(request);
  if (plan.window > 0) cameras_.push_back(plan.window_end);
  ViewDemand demand{cameras_, request.detail_px, request.waits_for_pages};
  if (request.soon) {
    FrameRequest ahead = request;
    ahead.camera.world_from_camera = *request.soon;
    for (const Camera& camera : cameras_of(ahead)) demand.cameras.push_back(camera);
  }
  table_.reset();
  watch_->look(std::move(demand));
  if (request.waits_for_pages) tree_.settle(*watch_);
  changes_ = watch_->progress().changes;
  table_ = tree_.table();
  now_s_ = tree_.now_s();
}

void PagedFrame::end(FrameStats& stats) {
  if (!keeps_pages_) table_.reset();
  const Watch::Progress progress = watch_->progress();
  stats.missing_pages = progress.missing;
  stats.coarsest_px = progress.coarsest_px;
  stats.settled = !watch_->waits(now_s_);
}

}  // namespace catgs
