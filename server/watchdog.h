#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "server/liveness.h"

namespace catgs {

/// Gives up a process whose threads have stalled, for supervisors that start anew only what has
/// ended, whatever /healthz says: systemd, Docker. It counts its own rounds and not the time, so
/// that a process that was itself stopped for an hour has a minute to go on.
class Watchdog {
 public:
  static constexpr int rounds = 60;  // of a second, all of them with a complaint

  Watchdog(const Liveness& liveness, std::function<void(const std::string& why)> give_up,
           Clock::duration round = std::chrono::seconds(1));
  ~Watchdog() = default;  // ends the thread
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

 private:
  void watch(const std::stop_token& stop, Clock::duration round);

  const Liveness& liveness_;
  const std::function<void(const std::string&)> give_up_;
  std::mutex mutex_;
  std::condition_variable_any stopped_;
  std::jthread thread_;
};

}  // namespace catgs
