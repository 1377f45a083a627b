#include "render_core/tools/bench/bench_quality.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/image/png.h"
#include "render_core/tools/frame_feed.h"

namespace catgs {
namespace {

QualityReport judge_by_reference(const RenderSetup& setup, const ViewSettings& settings,
                                 const ProgressReport& report) {
  constexpr std::size_t max_frames = 8;  // the reference needs seconds for each on large scenes
  constexpr std::size_t pixels = 500;
  const std::size_t count = std::min(max_frames, setup.poses.size());
  QualityReport quality;
  quality.against = fmt::format("reference, {} random pixels of {} frames", pixels, count);
  quality.whole_images = false;
  const auto view = setup.made.renderer->make_view(settings);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = k * setup.poses.size() / count;
    FrameView frame;
    render_or_throw(*view, setup.request(i), frame);
    ImageQuality at_pixels;
    at_pixels.mean_squared_error = reference_error(setup, i, frame, pixels);
    (frame.stats.kind == FrameKind::key ? quality.key : quality.sub)
        .add(at_pixels, setup.first + i);
    report(static_cast<double>(k + 1) / static_cast<double>(count));
  }
  return quality;
}

/// Compares the judged pipeline with the exact one. Comparing costs more than rendering, so
/// pictures are gathered and compared in parallel.
class Judge {
 public:
  Judge(const RenderSetup& setup, QualityReport& quality)
      : setup_(setup),
        quality_(quality),
        exact_(setup.made.renderer->make_view({.pipeline = Pipeline::exact})) {}

  void compare(std::size_t i, FrameKind kind, const Image& judged) {
    const Image truth = exact_image(i, 0.0f);
    quality_.see_through.add(see_through(truth, exact_image(i, backdrop)));
    pairs_.push_back({kind, setup_.first + i, judged, truth, {}});
    if (pairs_.size() == std::min(max_pairs, static_cast<std::size_t>(setup_.pool->threads()))) {
      finish();
    }
  }

  /// `before` and `after`: frames i - 1 and i of the judged pipeline.
  void compare_step(std::size_t i, const Image& before, const Image& after) {
    const double excess =
        pop_excess({before, after}, {exact_image(i - 1, 0.0f), exact_image(i, 0.0f)});
    if (excess > quality_.pop.max) quality_.worst_pop_frame = setup_.first + i;
    quality_.pop.add(excess);
    quality_.pops += excess > max_pop ? 1 : 0;
  }

  void finish() {
    setup_.pool->parallel_for(pairs_.size(), [this](std::size_t i) {
      pairs_[i].quality = compare_images(pairs_[i].judged, pairs_[i].truth);
    });
    for (const Pair& pair : pairs_) {
      const bool key = pair.kind == FrameKind::key;
      QualityTally& tally = key ? quality_.key : quality_.sub;
      WorstFrames& worst = key ? quality_.worst_key : quality_.worst_sub;
      tally.add(pair.quality, pair.frame);
      const JudgedFrame frame{pair.frame, pair.judged, pair.truth};
      if (tally.worst_frame() == pair.frame) worst.frame = frame;
      if (tally.worst_block_frame() == pair.frame) worst.block = frame;
    }
    pairs_.clear();
  }

 private:
  static constexpr std::size_t max_pairs = 16;  // bounds the memory of pictures
  static constexpr float backdrop = 0.5f;

  struct Pair {
    FrameKind kind;
    std::size_t frame;
    Image judged, truth;
    ImageQuality quality;
  };

  Image exact_image(std::size_t i, float background) {
    FrameRequest request = setup_.request(i);
    request.background = glm::vec3(background);
    request.detail_px = 0.0f;  // of a tree, all Gaussians
    FrameView frame;
    render_or_throw(*exact_, request, frame);
    return copy_image(frame);
  }

  /// A pixel over a background b is C + T b, so two backgrounds tell its transmittance T. A channel
  /// clamped at 1 shows less of it; hence the largest of the three.
  static double see_through(const Image& over_black, const Image& over_backdrop) {
    std::size_t count = 0;
    for (std::size_t p = 0; p < over_black.rgb.size(); p += 3) {
      float difference = 0.0f;
      for (std::size_t c = p; c < p + 3; ++c) {
        difference = std::max(difference, over_backdrop.rgb[c] - over_black.rgb[c]);
      }
      count += difference > 0.5f * backdrop ? 1 : 0;
    }
    return static_cast<double>(count) / static_cast<double>(over_black.pixels());
  }

  const RenderSetup& setup_;
  QualityReport& quality_;
  std::unique_ptr<View> exact_;
  std::vector<Pair> pairs_;
};

QualityReport judge_by_exact(const RenderSetup& setup, const ViewSettings& settings,
                             std::size_t every, const ProgressReport& report) {
  QualityReport quality;
  quality.against = every == 1 ? "exact pipeline, every frame"
                               : fmt::format("exact pipeline, one frame in {}", every);
  const auto view = setup.made.renderer->make_view(settings);
  FrameFeed feed(setup, settings);
  Judge judge(setup, quality);
  Image before;
  std::size_t steps = 0;
  for (std::size_t i = 0; i < setup.poses.size(); ++i) {
    FrameView frame;  // every frame is rendered, because caches depend on earlier frames
    render_or_throw(*view, feed.next(), frame);
    const FrameKind kind = frame.stats.kind;
    Image image = copy_image(frame);
    if (kind == FrameKind::key && i > 0 && steps++ % every == 0) {
      judge.compare_step(i, before, image);
    }
    if (i % every == 0) judge.compare(i, kind, image);
    before = std::move(image);
    report(static_cast<double>(i + 1) / static_cast<double>(setup.poses.size()));
  }
  judge.finish();
  return quality;
}

Image difference(const JudgedFrame& frame) {
  constexpr float gain = 16.0f;
  Image image{frame.judged.size_px, {}};
  image.rgb.reserve(frame.judged.rgb.size());
  for (std::size_t i = 0; i < frame.judged.rgb.size(); ++i) {
    const float off = std::abs(frame.judged.rgb[i] - frame.truth.rgb[i]);
    image.rgb.push_back(std::min(1.0f, gain * off));
  }
  return image;
}

}  // namespace

void QualityTally::add(const ImageQuality& quality, std::size_t frame) {
  if (frames_ == 0 || quality.mean_squared_error > max_error_) worst_frame_ = frame;
  ++frames_;
  error_sum_ += quality.mean_squared_error;
  max_error_ = std::max(max_error_, quality.mean_squared_error);
  ssim_sum_ += quality.ssim;
  min_ssim_ = std::min(min_ssim_, quality.ssim);
  if (quality.block_errors.empty()) return;
  if (frames_ == 1 || quality.worst_block_psnr() < worst_block_psnr_) worst_block_frame_ = frame;
  worst_block_psnr_ = std::min(worst_block_psnr_, quality.worst_block_psnr());
  block_0_1_percent_psnr_ = std::min(block_0_1_percent_psnr_, quality.block_0_1_percent_psnr());
}

void QualityTally::add(const QualityTally& other) {
  if (other.frames_ == 0) return;
  if (frames_ == 0 || other.max_error_ > max_error_) worst_frame_ = other.worst_frame_;
  if (frames_ == 0 || other.worst_block_psnr_ < worst_block_psnr_) {
    worst_block_frame_ = other.worst_block_frame_;
  }
  frames_ += other.frames_;
  error_sum_ += other.error_sum_;
  max_error_ = std::max(max_error_, other.max_error_);
  ssim_sum_ += other.ssim_sum_;
  min_ssim_ = std::min(min_ssim_, other.min_ssim_);
  worst_block_psnr_ = std::min(worst_block_psnr_, other.worst_block_psnr_);
  block_0_1_percent_psnr_ = std::min(block_0_1_percent_psnr_, other.block_0_1_percent_psnr_);
}

double QualityTally::mean_psnr() const {
  return psnr_db(error_sum_ / static_cast<double>(std::max<std::size_t>(frames_, 1)));
}

double QualityTally::mean_ssim() const {
  return ssim_sum_ / static_cast<double>(std::max<std::size_t>(frames_, 1));
}

void Extent::add(double value) {
  max = count == 0 ? value : std::max(max, value);
  sum += value;
  ++count;
}

void make_worst_frames_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder.string(), "", "cannot be made", error.message());
  check_writable(folder / "key_worst_frame.png");
}

void write_worst_frames(const std::filesystem::path& folder, const QualityReport& report) {
  const auto write = [&](std::string_view what, const JudgedFrame& frame) {
    if (frame.judged.rgb.empty()) return;
    const std::string name = fmt::format("{}_{:06}", what, frame.number);
    write_png(folder / (name + ".png"), frame.judged);
    write_png(folder / (name + "_exact.png"), frame.truth);
    write_png(folder / (name + "_difference.png"), difference(frame));
  };
  write("key_worst_frame", report.worst_key.frame);
  write("key_worst_block", report.worst_key.block);
  write("sub_worst_frame", report.worst_sub.frame);
  write("sub_worst_block", report.worst_sub.block);
}

void Extent::add(const Extent& other) {
  if (other.count == 0) return;
  max = count == 0 ? other.max : std::max(max, other.max);
  sum += other.sum;
  count += other.count;
}

QualityReport judge(const RenderSetup& setup, const ViewSettings& settings, std::size_t every,
                    const ProgressReport& report) {
  assert(every > 0);
  return settings.pipeline == Pipeline::exact ? judge_by_reference(setup, settings, report)
                                              : judge_by_exact(setup, settings, every, report);
}

}  // namespace catgs
