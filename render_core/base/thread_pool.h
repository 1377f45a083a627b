#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace catgs {

/// Those that this process may run on, not all of the machine: std::thread::hardware_concurrency()
/// counts the latter with glibc 2.35 and later.
int processors();

/// Threads shared by rendering and encoding. Work is parallel across tasks first: a frame's inner
/// loops (`parallel_for`) are helped only by workers that have nothing else to do, so that with as
/// many sessions as threads each frame stays on its own core.
class ThreadPool {
 public:
  /// Starts `threads` workers for tasks; a loop runs on at most `threads` threads, its caller
  /// included. 0: one per core.
  explicit ThreadPool(int threads = 0);
  ~ThreadPool();  // finishes submitted tasks, then joins
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  [[nodiscard]] int threads() const { return threads_; }

  /// Runs `task` on a worker. Tasks start in the order of submission.
  void submit(std::function<void()> task);

  /// Calls body(i) once for every i in [0, count), on the calling thread and on idle workers, and
  /// returns when all calls have ended. Indices are handed out one by one: make a call worth a few
  /// microseconds. May be called from inside a task. When a call throws, indices not yet handed out
  /// are dropped and the first exception is thrown again here. Allocates nothing.
  template <class Body>
  void parallel_for(std::size_t count, const Body& body) {
    run_loop(count,
             {&body, [](const void* b, std::size_t i) { (*static_cast<const Body*>(b))(i); }});
  }

 private:
  /// A borrowed callable: std::function would allocate for every frame stage.
  struct BodyRef {
    const void* body;
    void (*call)(const void* body, std::size_t i);
    void operator()(std::size_t i) const { call(body, i); }
  };
  struct Loop;
  void run_loop(std::size_t count, BodyRef body);
  [[nodiscard]] Loop* loop_to_help() const;  // mutex held
  void work(const std::stop_token& stop);

  int threads_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::deque<std::function<void()>> tasks_;
  std::vector<Loop*> loops_;  // loops with indices left, oldest first; owned by their callers
  std::vector<std::jthread> workers_;
};

}  // namespace catgs
