#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "server/base/liveness.h"

namespace catgs {

/// Gives up a process whose threads have stalled. It serves supervisors such as systemd and Docker,
/// which only restart processes that have ended. It counts its own rounds instead of time, so that
/// a process suspended for an hour still has a minute to continue.
class Watchdog {
 public:
  static constexpr int rounds = 60;  // of a second each, in a row with a complaint

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
