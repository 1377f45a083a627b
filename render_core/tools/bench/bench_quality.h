#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "render_core/image/image.h"
#include "render_core/metrics/image_quality.h"
#include "render_core/tools/bench/bench_measure.h"

namespace catgs {

/// Quality of a set of frames: the PSNR of their mean squared error, and the worst frame.
class QualityTally {
 public:
  /// `frame` is its number in the path.
  void add(const ImageQuality& quality, std::size_t frame);
  /// Adds all frames of another set. The worst frame keeps its number in that set.
  void add(const QualityTally& other);

  [[nodiscard]] std::size_t frames() const { return frames_; }
  [[nodiscard]] double mean_psnr() const;
  [[nodiscard]] double min_psnr() const { return psnr_db(max_error_); }
  [[nodiscard]] std::size_t worst_frame() const { return worst_frame_; }
  [[nodiscard]] double mean_ssim() const;
  [[nodiscard]] double min_ssim() const { return min_ssim_; }
  /// Worst 16x16 block of all frames; the 0.1 % block of the worst frame.
  [[nodiscard]] double worst_block_psnr() const { return worst_block_psnr_; }
  [[nodiscard]] std::size_t worst_block_frame() const { return worst_block_frame_; }
  [[nodiscard]] double block_0_1_percent_psnr() const { return block_0_1_percent_psnr_; }

 private:
  std::size_t frames_ = 0;
  std::size_t worst_frame_ = 0, worst_block_frame_ = 0;
  double error_sum_ = 0.0;
  double max_error_ = 0.0;
  double ssim_sum_ = 0.0;
  double min_ssim_ = 1.0;
  double worst_block_psnr_ = psnr_db(0.0);
  double block_0_1_percent_psnr_ = psnr_db(0.0);
};

/// Mean and largest value of a number per frame.
struct Extent {
  std::size_t count = 0;
  double sum = 0.0, max = 0.0;

  void add(double value);
  void add(const Extent& other);
  [[nodiscard]] double mean() const { return count == 0 ? 0.0 : sum / static_cast<double>(count); }
};

/// A frame and its ideal, for people to look at.
struct JudgedFrame {
  std::size_t number = 0;
  Image judged, truth;
};

/// The frame with the largest mean error, and the one with the worst block.
struct WorstFrames {
  JudgedFrame frame, block;
};

struct QualityReport {
  std::string against;       // "exact pipeline, every 10th frame"
  bool whole_images = true;  // else random pixels: no SSIM, no blocks, none of the following fields
  QualityTally key, sub;
  WorstFrames worst_key, worst_sub;
  // Share of pixels that more than half of the background shows through. A view of almost nothing
  // flatters every PSNR.
  Extent see_through;
  // pop_excess() at the steps from one frame to a key frame. All frames but those of the paper
  // pipeline are key frames.
  Extent pop;
  std::size_t pops = 0;  // steps over max_pop
  std::size_t worst_pop_frame = 0;
};

/// The largest change that a step may add to the one that the exact pipeline shows there.
inline constexpr double max_pop = 1.0 / 255.0;

/// Makes the folder for write_worst_frames(), and tries whether files can be created in it. Throws
/// InputError.
void make_worst_frames_folder(const std::filesystem::path& folder);

/// Writes the worst frames of a report on whole images into a folder:
/// sub_worst_frame_000123.png and …_exact.png, with …_difference.png, 16 times too bright. Throws
/// InputError.
void write_worst_frames(const std::filesystem::path& folder, const QualityReport& report);

/// Judges a pipeline at its own poses. The reference judges `exact`, at random pixels of a few
/// frames. The exact pipeline judges all others, on whole pictures: every `every`-th frame and
/// every `every`-th step to a key frame.
QualityReport judge(const RenderSetup& setup, const ViewSettings& settings, std::size_t every,
                    const ProgressReport& report);

}  // namespace catgs
