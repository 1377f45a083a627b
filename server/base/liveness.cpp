#include "server/base/liveness.h"

#include <utility>

#include <fmt/format.h>

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto session_patience = 10s;
// A frame of the largest scene and picture size takes a busy processor seconds.
constexpr auto frame_patience = 30s;

}  // namespace

Liveness::Liveness(std::function<TimePoint()> clock)
    : clock_(std::move(clock)), session_moved_(clock_()) {}

void Liveness::session_moved() {
  const std::lock_guard lock(mutex_);
  session_moved_ = clock_();
}

Liveness::Frame::Frame(std::shared_ptr<Frames> all, const std::function<TimePoint()>& clock)
    : all_(std::move(all)) {
  const std::lock_guard lock(all_->mutex);
  started_ = all_->started.insert(all_->started.end(), clock());
}

Liveness::Frame::~Frame() {
  const std::lock_guard lock(all_->mutex);
  all_->started.erase(started_);
}

std::shared_ptr<const void> Liveness::frame_started() {
  return std::make_shared<const Frame>(frames_, clock_);
}

std::array<Liveness::Loop, 2> Liveness::loops() const {
  const std::scoped_lock lock(mutex_, frames_->mutex);
  const TimePoint now = clock_();
  const TimePoint oldest = frames_->started.empty() ? now : frames_->started.front();
  return {{{"session", now - session_moved_, session_patience},
           {"frames", now - oldest, frame_patience}}};
}

std::string Liveness::complaint() const {
  std::string text;
  for (const Loop& loop : loops())
    if (loop.stalled > loop.patience)
      text += fmt::format("{}{} stalled for {} s", text.empty() ? "" : ", ", loop.name,
                          std::chrono::duration_cast<std::chrono::seconds>(loop.stalled).count());
  return text;
}

}  // namespace catgs
