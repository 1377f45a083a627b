#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <future>
#include <memory>
#include <utility>

#include <boost/asio/post.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/net/waker.h"

namespace catgs {

/// The threads on which HTTP answers wait for the disk, so that the network thread does not. Each
/// connection gives them one piece of work at a time.
class DiskThreads {
 public:
  explicit DiskThreads(std::shared_ptr<LwsWaker> waker) : waker_(std::move(waker)) {}
  ~DiskThreads() { join(); }
  DiskThreads(const DiskThreads&) = delete;
  DiskThreads& operator=(const DiskThreads&) = delete;

  /// Waits for the work under way. Afterwards none is done any more.
  void join() { threads_.join(); }

  static constexpr std::size_t most_waiting = 1024;

  /// Runs `work` and wakes the network thread for `waiter` when the result is there. Nothing is
  /// done for a waiter that is gone by then. An invalid future: so many wait that this one may not.
  template <typename Result>
  std::future<Result> run(std::function<Result()> work, std::weak_ptr<Wakeable> waiter) {
    if (waiting_ >= most_waiting) return {};
    ++waiting_;
    auto task = std::make_shared<std::packaged_task<Result()>>(std::move(work));
    auto result = task->get_future();
    boost::asio::post(threads_, [this, task = std::move(task), waiter = std::move(waiter)] {
      if (auto waits = waiter.lock()) {
        (*task)();
        waker_->wake(std::move(waits));
      }
      --waiting_;
    });
    return result;
  }

 private:
  const std::shared_ptr<LwsWaker> waker_;
  std::atomic<std::size_t> waiting_{0};  // or under way
  boost::asio::thread_pool threads_{2};
};

}  // namespace catgs
