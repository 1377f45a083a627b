#include "server/schedule/scheduler.h"

#include <utility>

namespace catgs {
namespace {

TimePoint latest_start(const FrameCandidate& candidate) {
  return candidate.deadline - candidate.cost;
}

}  // namespace

void FrameScheduler::frame_started(const FrameCandidate& frame) {
  ++running_;
  if (frame.key) ++key_frames_running_[frame.device];
}

void FrameScheduler::frame_ended(const FrameCandidate& frame) {
  --running_;
  if (frame.key) --key_frames_running_[frame.device];
}

bool FrameScheduler::can_wait(const FrameCandidate& candidate, TimePoint now) const {
  const auto running = key_frames_running_.find(candidate.device);
  return candidate.key && running != key_frames_running_.end() && running->second > 0 &&
         latest_start(candidate) > now;
}

std::optional<std::size_t> FrameScheduler::choose(std::span<const FrameCandidate> candidates,
                                                  TimePoint now) const {
  const auto rank = [&](const FrameCandidate& candidate) {
    return std::pair(can_wait(candidate, now), latest_start(candidate));
  };
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < candidates.size(); ++i)
    if (candidates[i].ready <= now && (!best || rank(candidates[i]) < rank(candidates[*best])))
      best = i;
  return best;
}

}  // namespace catgs
