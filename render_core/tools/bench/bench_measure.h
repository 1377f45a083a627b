#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "render_core/tools/render_setup.h"

namespace catgs {

/// Lists of a set of frames.
struct ListLength {
  double mean = 0.0;             // list entries per frame
  std::uint64_t max = 0;         // of a frame
  std::uint32_t tile_max = 0;    // longest list of a tile
  std::uint64_t overflowed = 0;  // entries that found no memory, all frames
  std::uint32_t giants_max = 0;  // see FrameStats
  std::uint64_t uncarried = 0;   // lists with too many of those, all frames
  double visible_mean = 0.0;
};

/// One pass over the path, or several: frames back to back, nothing skipped. The queries below take
/// all frames, or those of one kind.
struct Measurement {
  struct Frame {
    double ms = 0.0;  // since the completion of the frame before
    FrameStats stats;
    bool first = false;  // of a pass
  };
  std::vector<Frame> frames;   // pass by pass
  double wall_ms = 0.0;        // of the whole pass, so that the mean rate hides no work in between
  std::size_t view_bytes = 0;  // memory of a View at the end, which never shrinks

  using Kind = std::optional<FrameKind>;
  [[nodiscard]] double fps() const;
  [[nodiscard]] std::vector<double> frame_ms(Kind kind = std::nullopt) const;
  [[nodiscard]] double mean_stage_ms(Stage stage, Kind kind = std::nullopt) const;
  [[nodiscard]] ListLength list_length(Kind kind = std::nullopt) const;
  /// Key frames by the window that they promised.
  [[nodiscard]] std::map<int, std::size_t> window_histogram() const;
  [[nodiscard]] double frames_per_key() const;
  /// Share of the key frames that promised no sub-frames.
  [[nodiscard]] double keys_without_window() const;
  /// Groups that ended before their window, because the camera left its forecast.
  [[nodiscard]] std::size_t windows_cut() const;
};

using ProgressReport = std::function<void(double fraction)>;

/// How many frames of the path to render before measuring: as many as were asked for, which the
/// path must have, or by default 10, or all of a shorter path. Throws InputError.
inline constexpr std::size_t default_warmup = 10;
std::size_t warmup_frames(std::optional<std::size_t> asked, const RenderSetup& setup);

/// Renders the first `warmup` frames of the path unmeasured, then the whole path, with a View of
/// these settings whose frames stay on the device; or with several at the same time, each on a
/// thread of its own, and the wall clock of all. Throws as make_view() and render_or_throw().
Measurement measure(const RenderSetup& setup, ViewSettings settings, std::size_t warmup,
                    const ProgressReport& report, std::size_t views = 1);

/// Cost of the inner loop: blend time over (Gaussian, pixel) pairs blended, in nanoseconds of wall
/// clock. Pairs are counted afterwards on a few frames spread over the path, because counting costs
/// time; the time is that of the same frames in `measurement`. The frames of the catgs pipeline are
/// counted as key frames: a sub-frame blends the same pairs but for a few.
struct PairCost {
  double pairs_per_frame = 0.0;
  double ns_per_pair = 0.0;  // 0 when nothing was blended
};
PairCost count_pairs(const RenderSetup& setup, ViewSettings settings,
                     const Measurement& measurement);

}  // namespace catgs
