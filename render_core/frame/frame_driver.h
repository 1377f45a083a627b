#pragma once

#include <functional>
#include <optional>

#include "render_core/frame/renderer.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/motion/window_gain.h"

namespace catgs {

/// The part of View::render() that all cores share. It decides whether a frame is a key frame or a
/// sub-frame, and turns exceptions into a RenderStatus. One per View.
class FrameDriver {
 public:
  /// Draws one frame by its plan and waits for it. Need not fill in kind and window of the
  /// statistics. Nothing, where the lists of a sub-frame's group turn out not to hold: it is then
  /// asked for a key frame. Throws where it fails.
  using Draw = std::function<std::optional<FrameView>(const FramePlan&)>;
  /// Drops what a core keeps from frame to frame, after a failure.
  using Forget = std::function<void()>;

  enum class CatgsWindows { none, some };  // whether the core's Pipeline::catgs has windows

  /// Throws as check_speculation().
  explicit FrameDriver(const ViewSettings& settings, CatgsWindows catgs = CatgsWindows::none);

  /// As View::render().
  RenderStatus render(const FrameRequest& request, FrameView& frame, const Draw& draw,
                      const Forget& forget) noexcept;

 private:
  [[nodiscard]] FramePlan plan(const FrameRequest& request);
  [[nodiscard]] FramePlan with_window_if_it_pays(const FramePlan& plan, const Camera& camera);
  void note_time(const FrameStats& stats);

  ViewSettings settings_;
  bool groups_frames_;
  FrameGroups groups_;
  WindowGain gain_;
  WindowGain::Group last_group_;  // catgs: the present group until the next one begins
  int sub_frames_left_ = 0;       // of the present window
  float depth_ = 0.0f;            // of the last frame, as FrameGroups::plan() takes it
};

}  // namespace catgs
