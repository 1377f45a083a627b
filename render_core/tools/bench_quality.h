#pragma once

#include <cstddef>
#include <string>

#include "render_core/metrics/image_quality.h"
#include "render_core/tools/bench_measure.h"

namespace catgs {

/// Quality of a set of frames: PSNR of the mean squared error over them, and the worst of them.
class QualityTally {
 public:
  void add(const ImageQuality& quality);

  [[nodiscard]] std::size_t frames() const { return frames_; }
  [[nodiscard]] double mean_psnr() const;
  [[nodiscard]] double min_psnr() const { return psnr_db(max_error_); }
  [[nodiscard]] double mean_ssim() const;
  [[nodiscard]] double min_ssim() const { return min_ssim_; }
  /// Worst 16x16 block of all frames; the 0.1 % block of the worst frame.
  [[nodiscard]] double worst_block_psnr() const { return worst_block_psnr_; }
  [[nodiscard]] double block_0_1_percent_psnr() const { return block_0_1_percent_psnr_; }

 private:
  std::size_t frames_ = 0;
  double error_sum_ = 0.0;
  double max_error_ = 0.0;
  double ssim_sum_ = 0.0;
  double min_ssim_ = 1.0;
  double worst_block_psnr_ = psnr_db(0.0);
  double block_0_1_percent_psnr_ = psnr_db(0.0);
};

struct QualityReport {
  std::string against;       // "exact pipeline, every 10th frame"
  bool whole_images = true;  // else random pixels: no SSIM, no blocks
  QualityTally key, sub;
};

/// Judges the measured pipeline at its own poses: `exact` by the reference at random pixels of a
/// few frames, anything else by the exact pipeline on whole pictures of every `every`-th frame.
QualityReport judge(const RenderSetup& setup, std::size_t every, const ProgressReport& report);

}  // namespace catgs
