#include "render_core/tools/bench_quality.h"

#include <algorithm>

#include <fmt/format.h>

#include "render_core/image/png.h"
#include "render_core/tools/reference_check.h"

namespace catgs {
namespace {

QualityReport judge_by_reference(const RenderSetup& setup, const ProgressReport& report) {
  constexpr std::size_t max_frames = 8;  // the reference needs seconds for each on large scenes
  constexpr std::size_t pixels = 500;
  const std::size_t count = std::min(max_frames, setup.poses.size());
  QualityReport quality;
  quality.against = fmt::format("reference, {} random pixels of {} frames", pixels, count);
  quality.whole_images = false;
  const auto view = setup.made.renderer->make_view({});
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = k * setup.poses.size() / count;
    FrameView frame;
    render_or_throw(*view, setup.request(i), frame);
    ImageQuality at_pixels;
    at_pixels.mean_squared_error = reference_error(setup, i, frame, pixels);
    (frame.stats.kind == FrameKind::key ? quality.key : quality.sub).add(at_pixels);
    report(static_cast<double>(k + 1) / static_cast<double>(count));
  }
  return quality;
}

QualityReport judge_by_exact(const RenderSetup& setup, std::size_t every,
                             const ProgressReport& report) {
  QualityReport quality;
  quality.against = fmt::format("exact pipeline, every {} frames", every);
  const auto judged = setup.made.renderer->make_view({.pipeline = setup.pipeline});
  const auto exact = setup.made.renderer->make_view({.pipeline = Pipeline::exact});
  for (std::size_t i = 0; i < setup.poses.size(); ++i) {
    FrameView frame;  // every frame: a pipeline's caches depend on the frames before
    render_or_throw(*judged, setup.request(i), frame);
    if (i % every == 0) {
      FrameView truth;
      render_or_throw(*exact, setup.request(i), truth);
      (frame.stats.kind == FrameKind::key ? quality.key : quality.sub)
          .add(compare_images(copy_image(frame), copy_image(truth)));
    }
    report(static_cast<double>(i + 1) / static_cast<double>(setup.poses.size()));
  }
  return quality;
}

}  // namespace

void QualityTally::add(const ImageQuality& quality) {
  ++frames_;
  error_sum_ += quality.mean_squared_error;
  max_error_ = std::max(max_error_, quality.mean_squared_error);
  ssim_sum_ += quality.ssim;
  min_ssim_ = std::min(min_ssim_, quality.ssim);
  if (quality.block_errors.empty()) return;
  worst_block_psnr_ = std::min(worst_block_psnr_, quality.worst_block_psnr());
  block_0_1_percent_psnr_ = std::min(block_0_1_percent_psnr_, quality.block_0_1_percent_psnr());
}

double QualityTally::mean_psnr() const {
  return psnr_db(error_sum_ / static_cast<double>(std::max<std::size_t>(frames_, 1)));
}

double QualityTally::mean_ssim() const {
  return ssim_sum_ / static_cast<double>(std::max<std::size_t>(frames_, 1));
}

QualityReport judge(const RenderSetup& setup, std::size_t every, const ProgressReport& report) {
  return setup.pipeline == Pipeline::exact ? judge_by_reference(setup, report)
                                           : judge_by_exact(setup, every, report);
}

}  // namespace catgs
