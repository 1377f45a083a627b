#include "server/base/watchdog.h"

#include <utility>

namespace catgs {

Watchdog::Watchdog(const Liveness& liveness, std::function<void(const std::string& why)> give_up,
                   Clock::duration round)
    : liveness_(liveness),
      give_up_(std::move(give_up)),
      thread_([this, round](const std::stop_token& stop) { watch(stop, round); }) {}

void Watchdog::watch(const std::stop_token& stop, Clock::duration round) {
  std::unique_lock lock(mutex_);
  for (int stalled = 0; stalled < rounds;) {
    stopped_.wait_for(lock, stop, round, [] { return false; });
    if (stop.stop_requested()) return;
    stalled = liveness_.complaint().empty() ? 0 : stalled + 1;
  }
  give_up_(liveness_.complaint());
}

}  // namespace catgs
