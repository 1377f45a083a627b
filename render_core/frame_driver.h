#pragma once

#include <functional>
#include <optional>

#include "render_core/motion/frame_groups.h"
#include "render_core/motion/speculation_costs.h"
#include "render_core/renderer.h"

namespace catgs {

/// The part of View::render() that all cores share. It decides whether a frame is a key frame or a
/// sub-frame. It draws a sub-frame again as a key frame where its lists are not enough. It learns
/// from the statistics and turns exceptions into a RenderStatus. One per View.
class FrameDriver {
 public:
  /// Draws one frame by its plan and waits for it. Need not fill in kind and window of the
  /// statistics. An empty result means that the lists of a sub-frame are not enough; key frames
  /// always succeed or throw.
  using Draw = std::function<std::optional<FrameView>(const FramePlan&)>;
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
  SpeculationCosts costs_;
  SceneDepths depths_;  // of the last frame
};

}  // namespace catgs
