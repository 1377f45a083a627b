#pragma once

#include <functional>
#include <optional>

#include "render_core/frame/renderer.h"
#include "render_core/motion/frame_groups.h"

namespace catgs {

/// The part of View::render() that all cores share. It decides whether a frame is a key frame or a
/// sub-frame, and turns exceptions into a RenderStatus. One per View.
class FrameDriver {
 public:
  /// Draws one frame by its plan and waits for it. Need not fill in kind and window of the
  /// statistics. Throws where it fails.
  using Draw = std::function<FrameView(const FramePlan&)>;
  /// Drops what a core keeps from frame to frame, after a failure.
  using Forget = std::function<void()>;

  /// Throws as check_speculation().
  explicit FrameDriver(const ViewSettings& settings);

  /// As View::render().
  RenderStatus render(const FrameRequest& request, FrameView& frame, const Draw& draw,
                      const Forget& forget) noexcept;

 private:
  [[nodiscard]] FramePlan plan(const FrameRequest& request);

  ViewSettings settings_;
  FrameGroups groups_;
  float nearest_depth_ = 0.0f;  // of the last frame
};

}  // namespace catgs
