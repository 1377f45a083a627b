#include "server/schedule/scheduler.h"

namespace catgs {

std::optional<std::size_t> FrameScheduler::choose(std::span<const FrameCandidate> candidates,
                                                  TimePoint now) {
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < candidates.size(); ++i)
    if (candidates[i].ready <= now &&
        (!best || candidates[i].deadline < candidates[*best].deadline))
      best = i;
  return best;
}

}  // namespace catgs
