#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "render_core/tools/render_setup.h"

namespace catgs {

/// One pass over the path: frames back to back, nothing skipped.
struct Measurement {
  struct Frame {
    double ms = 0.0;  // since the completion of the frame before
    FrameStats stats;
  };
  std::vector<Frame> frames;
  double wall_ms = 0.0;  // of the whole pass, so that the mean rate hides no work between frames

  [[nodiscard]] double fps() const;
  /// Frame times of one kind.
  [[nodiscard]] std::vector<double> frame_ms(FrameKind kind) const;
  [[nodiscard]] std::vector<double> frame_ms() const;
  [[nodiscard]] double mean_stage_ms(Stage stage) const;
};

using ProgressReport = std::function<void(double fraction)>;

/// Renders the first `warmup` frames of the path unmeasured, then the whole path. Throws as
/// render_or_throw().
Measurement measure(const RenderSetup& setup, std::size_t warmup, const ProgressReport& report);

/// Cost of the inner loop: blend time over (Gaussian, pixel) pairs blended, in nanoseconds of wall
/// clock. Pairs are counted afterwards on a few frames spread over the path, because counting costs
/// time; the time is that of the same frames in `measurement`.
struct PairCost {
  double pairs_per_frame = 0.0;
  double ns_per_pair = 0.0;  // 0 when nothing was blended
};
PairCost count_pairs(const RenderSetup& setup, const Measurement& measurement);

}  // namespace catgs
