#pragma once

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
  ~DiskThreads() { threads_.join(); }
  DiskThreads(const DiskThreads&) = delete;
  DiskThreads& operator=(const DiskThreads&) = delete;

  /// Runs `work` and wakes the network thread for `waiter` when the result is there.
  template <typename Result>
  std::future<Result> run(std::function<Result()> work, std::shared_ptr<Wakeable> waiter) {
    auto task = std::make_shared<std::packaged_task<Result()>>(std::move(work));
    auto result = task->get_future();
    boost::asio::post(threads_,
                      [waker = waker_, task = std::move(task), waiter = std::move(waiter)] {
                        (*task)();
                        waker->wake(waiter);
                      });
    return result;
  }

 private:
  const std::shared_ptr<LwsWaker> waker_;
  boost::asio::thread_pool threads_{2};
};

}  // namespace catgs
