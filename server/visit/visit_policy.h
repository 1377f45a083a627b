#pragma once

#include <chrono>

#include "server/encode/encoder.h"

namespace catgs {

/// Ticks come every 250 ms, and a client hears something at least once a second.
inline constexpr std::chrono::milliseconds speak_at_least_every{750};

/// The server's limits for one visit.
struct VisitPolicy {
  std::chrono::milliseconds hello_timeout{5000};
  std::chrono::milliseconds idle_timeout{15 * 60 * 1000};  // 0: never
  std::chrono::milliseconds idle_warning{30'000};          // before the timeout
  std::chrono::milliseconds resume_grace{30'000};  // a lost client may come back for so long
  std::chrono::milliseconds longest_wait{10 * 60 * 1000};  // for a slot
  /// A client that has waited for so long is not overtaken any more by those who ask for less.
  std::chrono::milliseconds overtaken_at_most{30'000};
  int default_fps = 60;
  int max_fps = 120;
  int default_bitrate_kbps = 8000;
  int max_bitrate_kbps = 100'000;
  int max_pixels = 3840 * 2160;  // larger requests are scaled down
  float detail_px = 0.5f;        // of trees: the finest, see DetailLadder
  bool forecasts = true;         // pictures of where the camera will be when they are seen
  bool quality_ladder = true;    // false: for slow links and decoders only the bitrate falls
  double x264_aq = default_aq_strength;
  std::chrono::milliseconds still_after{100};  // without another view, at least: see Rest
  int refine_frames = 60;  // that sharpen a still picture at most, where the link is slow
  /// Between encoders that a client's settings ask for; the newest ones count.
  std::chrono::milliseconds settings_gap{250};
  std::chrono::milliseconds select_gap{250};  // between scenes that it asks for; likewise
};

}  // namespace catgs
