#include "render_core/tools/progress.h"

#include <algorithm>
#include <cstdio>

#include <fmt/format.h>
#include <unistd.h>

namespace catgs {

Progress::Progress(std::string_view label, bool quiet)
    : label_(label), enabled_(!quiet && isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (drawn_) fmt::print(stderr, "\r\x1b[K");
}

void Progress::update(double fraction, std::string_view note) {
  if (!enabled_) return;
  const auto now = std::chrono::steady_clock::now();
  if (drawn_ && now - last_draw_ < std::chrono::milliseconds(100)) return;
  fmt::print(stderr, "\r\x1b[K{} {:3.0f} %{}{}", label_, 100.0 * std::clamp(fraction, 0.0, 1.0),
             note.empty() ? "" : "  ", note);
  std::fflush(stderr);
  drawn_ = true;
  last_draw_ = now;
}

}  // namespace catgs
