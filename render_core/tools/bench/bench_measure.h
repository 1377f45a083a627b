#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "render_core/tools/render_setup.h"

namespace catgs {

/// Length of the lists in a set of frames.
struct ListLength {
  double mean = 0.0;             // list entries per frame
  std::uint64_t max = 0;         // of a frame
  std::uint32_t tile_max = 0;    // longest list of a tile
  std::uint64_t overflowed = 0;  // entries that found no memory, all frames
  double visible_mean = 0.0;
};

/// The parts of a scene in pages that a set of frames drew, and those that it lacked.
struct PageUsage {
  double nodes_mean = 0.0;
  double missing_mean = 0.0;  // pages
  std::uint32_t missing_max = 0;
  float coarsest_px = 0.0f;  // the largest error that memory leaves
};

/// One pass over the path, or several: frames back to back, none skipped. The queries below are
/// about all frames, or those of one kind.
struct Measurement {
  struct Frame {
    double ms = 0.0;  // since the previous frame was complete
    FrameStats stats;
    bool first = false;  // of a pass
  };
  std::vector<Frame> frames;  // pass by pass
  double wall_ms = 0.0;       // of the whole pass, work between frames included
  // Scenes in pages: a camera jumps to places along the path, whose pages were not needed yet, and
  // rests. Time until no page makes its picture sharper, for each place; at most longest_rest_ms.
  std::vector<double> sharp_ms;
  std::size_t view_bytes = 0;  // memory of a View at the end; it never shrinks

  static constexpr double longest_rest_ms = 5000.0;

  using Kind = std::optional<FrameKind>;
  [[nodiscard]] double fps() const;
  [[nodiscard]] std::vector<double> frame_ms(Kind kind = std::nullopt) const;
  [[nodiscard]] double mean_stage_ms(Stage stage, Kind kind = std::nullopt) const;
  [[nodiscard]] ListLength list_length(Kind kind = std::nullopt) const;
  [[nodiscard]] PageUsage pages() const;
  /// Key frames by the window that they promised.
  [[nodiscard]] std::map<int, std::size_t> window_histogram() const;
  [[nodiscard]] double frames_per_key() const;
  /// Share of the key frames that promised no sub-frames.
  [[nodiscard]] double keys_without_window() const;
  /// Number of groups that ended before their window, because the camera left its forecast.
  [[nodiscard]] std::size_t windows_cut() const;
};

using ProgressReport = std::function<void(double fraction)>;

/// Number of frames of the path to render before measuring: the number requested, which the path
/// must have; by default 10, or all of a shorter path. Throws InputError.
inline constexpr std::size_t default_warmup = 10;
std::size_t warmup_frames(std::optional<std::size_t> asked, const RenderSetup& setup);

/// Renders the first `warmup` frames of the path unmeasured, then the whole path. The View has
/// these settings, and its frames stay on the device. With several Views, each renders at the same
/// time on a thread of its own, and the wall clock covers all. Throws as make_view() and
/// render_or_throw().
Measurement measure(const RenderSetup& setup, ViewSettings settings, std::size_t warmup,
                    const ProgressReport& report, std::size_t views = 1);

/// Cost of the inner loop: blend time over (Gaussian, pixel) pairs blended, in nanoseconds of wall
/// clock. Counting costs time, so pairs are counted afterwards on a few frames spread over the
/// path; the time is that of the same frames in `measurement`. The frame before each of them is
/// drawn first, because catgs leaves out what that one hides. All frames are key frames; a
/// sub-frame of the paper pipeline blends nearly the same pairs.
struct PairCost {
  double pairs_per_frame = 0.0;
  double ns_per_pair = 0.0;  // 0 when nothing was blended
};
PairCost count_pairs(const RenderSetup& setup, ViewSettings settings,
                     const Measurement& measurement);

}  // namespace catgs
