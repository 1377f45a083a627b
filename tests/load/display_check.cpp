#include "tests/load/display_check.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/thread_pool.h"
#include "render_core/image/png.h"
#include "render_core/metrics/image_quality.h"
#include "server/encode/decoder.h"
#include "tests/load/picture_check.h"

namespace catgs::load {
namespace {

constexpr double farthest_reach = 2.5;  // display.ts: beyond, the picture is left as it is
constexpr double best_psnr_db = 60.0;   // what a screen of 8 bits can show
constexpr double worst_apart_s = 0.5;
constexpr std::size_t worst_pairs = 3;

/// Decodes the frames of a log again, in their order.
class Playback {
 public:
  explicit Playback(const DisplayLog& log) : log_(log) {}

  /// `frame` never decreases.
  const Image& picture(std::size_t frame) {
    DecodedPicture picture;
    for (; next_ <= frame; ++next_) {
      const DisplayLog::Frame& encoded = log_.frames[next_];
      if (encoded.first) decoder_ = std::make_unique<Decoder>(encoded.codec);
      const EncodeStatus status = decoder_->decode(encoded.bitstream, picture);
      if (!status.ok) throw std::runtime_error("a frame decodes only once: " + status.message);
      if (next_ == frame) picture_ = rgb_of(picture);
    }
    return picture_;
  }

 private:
  const DisplayLog& log_;
  std::size_t next_ = 0;
  std::unique_ptr<Decoder> decoder_;
  Image picture_;
};

struct Pair {
  std::size_t refresh = 0;
  double uncovered = 0.0;
  Image shown, exact;
  double ssim = 0.0, psnr_db = 0.0;
};

/// As Display of the page draws it: on a canvas of the picture's scale, which the browser stretches
/// over the view.
Pair shown_at(const DisplayLog& log, std::size_t number, const Image& picture) {
  const DisplayLog::Refresh& refresh = log.refreshes[number];
  const glm::dvec2 view_px(log.view_px);
  const glm::dmat3 unmoved(1.0);
  glm::dmat3 matrix = unmoved;
  glm::ivec2 canvas_px = picture.size_px;
  if (refresh.distance > 0.0) {
    matrix = warp_matrix(log.frames[refresh.frame].eye, {refresh.camera, log.fov_y_rad},
                         static_cast<double>(picture.size_px.x) / picture.size_px.y,
                         view_px.x / view_px.y, refresh.distance);
    const glm::dvec2 reached = reach(matrix);
    if (std::max(reached.x, reached.y) > farthest_reach) {
      matrix = unmoved;
    } else {
      canvas_px.y = static_cast<int>(std::lround(picture.size_px.y / refresh.overscan));
      canvas_px.x = static_cast<int>(std::lround(canvas_px.y * view_px.x / view_px.y));
    }
  }
  Pair pair;
  pair.refresh = number;
  pair.uncovered = uncovered_share(matrix);
  const DisplayLog::Frame& frame = log.frames[refresh.frame];
  const bool warps = matrix != unmoved || canvas_px != picture.size_px;
  pair.shown = warps && frame.depths.cells.x > 0 ? warp_by_depths(picture, frame.depths, frame.eye,
                                                                  {refresh.camera, log.fov_y_rad},
                                                                  view_px.x / view_px.y, canvas_px)
                                                 : warp_image(picture, matrix, canvas_px);
  if (canvas_px != log.view_px) pair.shown = warp_image(pair.shown, unmoved, log.view_px);
  return pair;
}

/// The worst refreshes of a group, at different times.
class WorstPairs {
 public:
  void add(const Pair& pair, std::int64_t time_us) {
    const auto near = std::ranges::find_if(worst_, [&](const Worst& other) {
      return std::abs(1e-6 * static_cast<double>(other.time_us - time_us)) < worst_apart_s;
    });
    if (near != worst_.end() && near->pair.ssim <= pair.ssim) return;
    if (near != worst_.end()) worst_.erase(near);
    if (worst_.size() == worst_pairs && worst_.back().pair.ssim <= pair.ssim) return;
    worst_.push_back({pair, time_us});
    std::ranges::sort(worst_, {}, [](const Worst& worst) { return worst.pair.ssim; });
    worst_.resize(std::min(worst_.size(), worst_pairs));
  }

  void write(const std::filesystem::path& folder, std::string group) const {
    std::ranges::replace(group, '/', '-');
    std::filesystem::create_directories(folder);
    for (std::size_t i = 0; i < worst_.size(); ++i) {
      const std::string name = fmt::format("{}-{}", group, i + 1);
      write_png(folder / (name + "-shown.png"), worst_[i].pair.shown);
      write_png(folder / (name + "-exact.png"), worst_[i].pair.exact);
    }
  }

 private:
  struct Worst {
    Pair pair;
    std::int64_t time_us = 0;
  };
  std::vector<Worst> worst_;  // the worst first
};

/// Judges one session.
class Judge {
 public:
  Judge(ExactPictures& exact, ThreadPool& pool, SessionReport& session, WorstPairs& worst)
      : exact_(exact),
        pool_(pool),
        log_(*session.display),
        judged_(session.judged),
        worst_(worst) {}

  void run(int every) {
    for (std::size_t i = 0; i < log_.refreshes.size(); ++i) {
      const bool sampled = i % static_cast<std::size_t>(every) == 0;
      if (!sampled && !is_new_at_rest(i)) continue;
      judged_.push_back(judged(i, sampled));
      // At rest most refreshes show what the one before showed.
      repeats_.push_back(judged_.size() > 1 && same(i, last_));
      if (repeats_.back()) continue;
      last_ = i;
      pairs_.push_back(shown_at(log_, i, playback_.picture(log_.refreshes[i].frame)));
      const Camera camera =
          make_camera(log_.refreshes[i].camera, log_.view_px,
                      focal_from_fov_y(log_.fov_y_rad, log_.view_px.y), log_.near_z);
      pairs_.back().exact = exact_.draw(log_.scene_id, camera);
      if (pairs_.size() == static_cast<std::size_t>(pool_.threads())) compare();
    }
    compare();
  }

 private:
  [[nodiscard]] bool is_new_at_rest(std::size_t i) const {
    const auto& refreshes = log_.refreshes;
    return refreshes[i].rest > 0 && (i == 0 || refreshes[i - 1].rest != refreshes[i].rest ||
                                     refreshes[i - 1].frame != refreshes[i].frame);
  }

  [[nodiscard]] bool same(std::size_t a, std::size_t b) const {
    const DisplayLog::Refresh &x = log_.refreshes[a], &y = log_.refreshes[b];
    return x.frame == y.frame && x.overscan == y.overscan && x.distance == y.distance &&
           x.camera.position == y.camera.position && x.camera.orientation == y.camera.orientation;
  }

  [[nodiscard]] JudgedRefresh judged(std::size_t i, bool sampled) const {
    const DisplayLog::Refresh& refresh = log_.refreshes[i];
    return {.at_s = 1e-6 * static_cast<double>(refresh.time_us - log_.refreshes[0].time_us),
            .age_ms = ages_ms_[i],
            .sampled = sampled,
            .rest = refresh.rest,
            .after_us = refresh.after_us};
  }

  /// Compares the pairs that wait, each on a thread, and completes what was judged by them.
  void compare() {
    pool_.parallel_for(pairs_.size(), [&](std::size_t i) {
      Pair& pair = pairs_[i];
      pair.ssim = luma_ssim(pair.shown, pair.exact);
      pair.psnr_db = std::min(best_psnr_db, psnr_db(mean_squared_error(pair.shown, pair.exact)));
    });
    std::size_t pair = 0;
    for (; complete_ < judged_.size(); ++complete_) {
      JudgedRefresh& judged = judged_[complete_];
      const JudgedRefresh* before = complete_ > 0 ? &judged_[complete_ - 1] : nullptr;
      const bool repeats = repeats_[complete_];
      judged.ssim = repeats ? before->ssim : pairs_[pair].ssim;
      judged.psnr_db = repeats ? before->psnr_db : pairs_[pair].psnr_db;
      judged.uncovered = repeats ? before->uncovered : pairs_[pair].uncovered;
      if (!repeats) ++pair;
    }
    for (const Pair& one : pairs_) worst_.add(one, log_.refreshes[one.refresh].time_us);
    pairs_.clear();
  }

  ExactPictures& exact_;
  ThreadPool& pool_;
  const DisplayLog& log_;
  std::vector<JudgedRefresh>& judged_;
  WorstPairs& worst_;
  Playback playback_{log_};
  const std::vector<double> ages_ms_ = pose_ages_ms(log_);
  std::vector<Pair> pairs_;    // not compared yet
  std::vector<bool> repeats_;  // of judged_: shows what the one before did
  std::size_t last_ = 0;       // the refresh of the newest pair
  std::size_t complete_ = 0;   // of judged_
};

}  // namespace

void check_displays(const DisplayCheck& check, RunReport& report) {
  ExactPictures exact(check.scenes);
  ThreadPool pool;
  for (GroupReport& group : report.groups) {
    WorstPairs worst;
    for (const auto& session : group.sessions) {
      if (!session->display || session->display->refreshes.empty()) continue;
      Judge(exact, pool, *session, worst).run(check.every);
    }
    if (!check.worst_folder.empty()) worst.write(check.worst_folder, group.name);
  }
}

}  // namespace catgs::load
