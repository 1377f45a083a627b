#pragma once

#include <cstddef>

#include "render_core/motion/predictor.h"
#include "render_core/tools/render_setup.h"

namespace catgs {

/// The requests of a path in order. Each has the forecast that a server could have made at its
/// time: the predictor has seen the recorded samples up to the frame's time, and no later ones. A
/// resampled path is interpolated towards the next sample, so its poses are never given to the
/// predictor.
class FrameFeed {
 public:
  /// Both belong to the caller. Pipelines with groups get forecasts, over their initial window.
  FrameFeed(const RenderSetup& setup, const ViewSettings& settings);

  /// The request of frame 0, 1, … of the path.
  FrameRequest next();

 private:
  const RenderSetup& setup_;
  int forecast_frames_;
  MotionPredictor predictor_;
  std::size_t next_sample_ = 0;
  std::size_t next_frame_ = 0;
};

}  // namespace catgs
