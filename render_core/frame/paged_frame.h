#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "render_core/frame/renderer.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/scene/tree/paged_tree.h"

namespace catgs {

/// The part of a View that all cores share for scenes in pages. It tells the pool of
/// pages what the View looks at, and holds the table of the pages that its frames read.
class PagedFrame {
 public:
  /// `tree` must outlive it. Throws InputError for a pipeline that cannot draw pages.
  PagedFrame(PagedTree& tree, const ViewSettings& settings);

  /// Call before a frame is drawn that finds its clusters afresh.
  void begin(const FrameRequest& request, const FramePlan& plan);
  /// Valid from begin() to end().
  [[nodiscard]] const PageTable& table() const { return *table_; }
  /// The frame's time, as PageInSlot::shown_since_s.
  [[nodiscard]] double now_s() const { return now_s_; }
  /// The cameras that the frame draws for: those of its eyes now, and the one at the end of its
  /// window if it has one.
  [[nodiscard]] const std::vector<Camera>& cameras() const { return cameras_; }

  /// Call after each frame. Fills in what the statistics say of pages. The pages of a frame that no
  /// sub-frame follows may go from now on.
  void end(FrameStats& stats);
  /// See View::outdated().
  [[nodiscard]] bool outdated() const { return watch_->progress().changes != changes_; }

 private:
  PagedTree& tree_;
  bool keeps_pages_ = false;  // for sub-frames
  std::shared_ptr<Watch> watch_;
  std::shared_ptr<const PageTable> table_;
  std::uint64_t changes_ = 0;  // of the watch, when the table was taken
  double now_s_ = 0.0;
  std::vector<Camera> cameras_;
};

}  // namespace catgs
