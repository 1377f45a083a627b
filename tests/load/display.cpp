#include "tests/load/display.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace catgs::load {

std::vector<double> pose_ages_ms(const DisplayLog& log) {
  std::vector<double> ages_ms;
  std::int64_t rested_us = 0;  // the camera was where it was until then
  for (const DisplayLog::Refresh& refresh : log.refreshes) {
    if (refresh.rest > 0) rested_us = refresh.time_us;
    const std::int64_t left_us = std::max(log.frames[refresh.frame].pose_us, rested_us);
    const double age_ms = 1e-3 * static_cast<double>(refresh.time_us - left_us);
    ages_ms.push_back(refresh.rest > 0 ? std::nan("") : age_ms);
  }
  return ages_ms;
}

std::vector<double> freezes_ms(const DisplayLog& log) {
  constexpr std::size_t averaged = 30;
  std::vector<double> intervals_ms, freezes_ms;
  const DisplayLog::Refresh* changed = nullptr;  // where the frame on show came
  for (const DisplayLog::Refresh& refresh : log.refreshes) {
    const bool is_last = &refresh == &log.refreshes.back();
    // An interval ends with a new frame, with the log, or when the camera comes to rest.
    const bool open = changed != nullptr && changed->rest == 0;
    const bool rests = refresh.rest > 0;
    const bool same = open && refresh.frame == changed->frame;
    if (same && !rests && !is_last) continue;
    if (open && (same || !rests)) {
      const double interval_ms = 1e-3 * static_cast<double>(refresh.time_us - changed->time_us);
      const std::size_t known = std::min(averaged, intervals_ms.size());
      const double sum = std::accumulate(intervals_ms.end() - static_cast<std::ptrdiff_t>(known),
                                         intervals_ms.end(), 0.0);
      const double mean = sum / static_cast<double>(std::max<std::size_t>(known, 1));
      if (interval_ms >= std::max(3.0 * mean, mean + 150.0)) freezes_ms.push_back(interval_ms);
      if (!rests) intervals_ms.push_back(interval_ms);
    }
    changed = &refresh;
  }
  return freezes_ms;
}

}  // namespace catgs::load
