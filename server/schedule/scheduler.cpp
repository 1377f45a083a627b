#include "server/schedule/scheduler.h"

#include <utility>

namespace catgs {
namespace {

TimePoint latest_start(const FrameCandidate& candidate) {
  return candidate.deadline - candidate.cost;
}

}  // namespace

void FrameScheduler::frame_started(const FrameCandidate& frame) {
  OnDevice& device = running_on_[frame.device];
  ++running_;
  ++device.frames;
  if (frame.key) ++device.key_frames;
}

void FrameScheduler::frame_ended(const FrameCandidate& frame) {
  OnDevice& device = running_on_[frame.device];
  --running_;
  --device.frames;
  if (frame.key) --device.key_frames;
}

FrameScheduler::OnDevice FrameScheduler::running_on(std::optional<int> device) const {
  const auto found = running_on_.find(device);
  return found == running_on_.end() ? OnDevice{} : found->second;
}

std::optional<std::size_t> FrameScheduler::choose(std::span<const FrameCandidate> candidates,
                                                  TimePoint now) const {
  using Rank = std::pair<bool, TimePoint>;
  std::optional<std::size_t> best;
  Rank best_rank;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const FrameCandidate& candidate = candidates[i];
    const OnDevice device = running_on(candidate.device);
    if (candidate.ready > now || device.frames >= slots_of_device_) continue;
    const bool can_wait = candidate.key && device.key_frames > 0 && latest_start(candidate) > now;
    const Rank rank{can_wait, latest_start(candidate)};
    if (best && best_rank <= rank) continue;
    best = i;
    best_rank = rank;
  }
  return best;
}

}  // namespace catgs
