#include "render_core/base/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <exception>
#include <utility>

#include "render_core/base/cpu_limit.h"

namespace catgs {

int processors() { return threads_for(CpuLimit().cpus()); }

struct ThreadPool::Loop {
  Loop(std::size_t n, BodyRef f) : count(n), body(f) {}

  const std::size_t count;
  const BodyRef body;
  std::atomic<std::size_t> next{0};
  int helpers = 0;  // workers inside run(); guarded by the pool's mutex
  std::condition_variable left;
  std::exception_ptr failure;  // the first one; guarded by the pool's mutex

  void run(std::mutex& mutex) {
    try {
      for (std::size_t i; (i = next.fetch_add(1, std::memory_order_relaxed)) < count;) body(i);
    } catch (...) {
      next.store(count, std::memory_order_relaxed);
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  }
};

ThreadPool::ThreadPool(int threads) : threads_(threads > 0 ? threads : processors()) {
  assert(threads >= 0);
  start_workers();
}

void ThreadPool::start_workers() {
  for (int i = static_cast<int>(workers_.size()); i < threads_; ++i)
    workers_.emplace_back([this, i](const std::stop_token& stop) { work(stop, i); });
}

void ThreadPool::set_threads(int threads) {
  assert(threads > 0);
  {
    const std::lock_guard lock(mutex_);
    threads_ = threads;
  }
  start_workers();
  resting_.notify_all();
  wake_.notify_all();
}

ThreadPool::~ThreadPool() {
  for (auto& worker : workers_) worker.request_stop();
  wake_.notify_all();
  workers_.clear();
}

void ThreadPool::submit(std::function<void()> task) {
  assert(task);
  {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  wake_.notify_one();
}

void ThreadPool::run_loop(std::size_t count, BodyRef body) {
  if (threads_ == 1 || count <= 1) {
    for (std::size_t i = 0; i < count; ++i) body(i);
    return;
  }
  Loop loop(count, body);
  {
    const std::lock_guard lock(mutex_);
    loops_.push_back(&loop);
  }
  wake_.notify_all();
  loop.run(mutex_);
  std::unique_lock lock(mutex_);
  std::erase(loops_, &loop);
  loop.left.wait(lock, [&] { return loop.helpers == 0; });
  if (loop.failure) std::rethrow_exception(loop.failure);
}

ThreadPool::Loop* ThreadPool::loop_to_help() const {
  // The caller of a loop works on it too, hence one helper fewer than threads.
  const auto loop = std::find_if(loops_.begin(), loops_.end(),
                                 [this](const Loop* l) { return l->helpers < threads_ - 1; });
  return loop == loops_.end() ? nullptr : *loop;
}

void ThreadPool::work(const std::stop_token& stop, int index) {
  std::unique_lock lock(mutex_);
  for (;;) {
    if (!resting_.wait(lock, stop, [&] { return index < threads_; })) return;
    wake_.wait(lock, stop,
               [&] { return index >= threads_ || !tasks_.empty() || loop_to_help() != nullptr; });
    if (index >= threads_) continue;
    if (!tasks_.empty()) {
      auto task = std::move(tasks_.front());
      tasks_.pop_front();
      lock.unlock();
      task();
      task = nullptr;
      lock.lock();
    } else if (Loop* loop = loop_to_help()) {
      ++loop->helpers;
      lock.unlock();
      loop->run(mutex_);
      lock.lock();
      // All its indices are handed out, so no other worker needs to look at it.
      std::erase(loops_, loop);
      if (--loop->helpers == 0) loop->left.notify_all();
    } else if (stop.stop_requested()) {
      return;
    }
  }
}

}  // namespace catgs
