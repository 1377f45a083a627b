#pragma once

#include <functional>
#include <future>
#include <memory>
#include <utility>

#include "server/base/background.h"
#include "server/net/waker.h"

namespace catgs {

/// The work of HTTP answers that waits for the disk. Each connection has one piece of work at a
/// time.
class DiskJobs {
 public:
  DiskJobs(Background& background, std::shared_ptr<LwsWaker> waker)
      : waker_(std::move(waker)), jobs_(background) {}

  /// Waits for the work under way. Afterwards none is done any more.
  void end() { jobs_.end(); }

  /// Runs `work` and wakes the network thread for `waiter` when the result is there. Nothing is
  /// done for a waiter that is gone by then. An invalid future: so many wait that this one may not.
  template <typename Result>
  std::future<Result> run(std::function<Result()> work, std::weak_ptr<Wakeable> waiter) {
    auto task = std::make_shared<std::packaged_task<Result()>>(std::move(work));
    auto result = task->get_future();
    const auto job = jobs_.start(
        lanes.disk, Priority::normal,
        [this, task = std::move(task), waiter = std::move(waiter)](const std::stop_token&) {
          auto waits = waiter.lock();
          if (!waits) return;
          (*task)();
          waker_->wake(std::move(waits));
        });
    return job != 0 ? std::move(result) : std::future<Result>();
  }

 private:
  const std::shared_ptr<LwsWaker> waker_;
  Background::Jobs jobs_;
};

}  // namespace catgs
