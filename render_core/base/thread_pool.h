#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace catgs {

/// The threads that this process can keep busy: see CpuLimit.
int processors();

/// Threads shared by rendering and encoding. Work is parallel across tasks first: only workers that
/// have nothing else to do help with a frame's inner loops (`parallel_for`). With as many sessions
/// as threads, each frame therefore stays on its own core.
class ThreadPool {
 public:
  /// Starts `threads` workers for tasks; 0 means one per processor. A loop runs on at most
  /// `threads` threads, its caller included.
  explicit ThreadPool(int threads = 0);
  ~ThreadPool();  // finishes submitted tasks, then joins
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  [[nodiscard]] int threads() const { return threads_; }
  /// Lets at most `threads` (1 or more) run from now on, and starts those that are missing. Running
  /// tasks end where they are. A loop may meet both numbers, so read threads() once for each use.
  void set_threads(int threads);

  /// Runs `task` on a worker. Tasks start in the order of submission.
  void submit(std::function<void()> task);

  /// Calls body(i) once for every i in [0, count), on the calling thread and on idle workers, and
  /// returns when all calls have ended. Indices are handed out one by one, so a call should take a
  /// few microseconds or more. May be called from inside a task. When a call throws, the remaining
  /// indices are dropped and the first exception is rethrown here. Allocates nothing.
  template <class Body>
  void parallel_for(std::size_t count, const Body& body) {
    run_loop(count,
             {&body, [](const void* b, std::size_t i) { (*static_cast<const Body*>(b))(i); }});
  }

 private:
  /// A borrowed callable. std::function would allocate for every frame stage.
  struct BodyRef {
    const void* body;
    void (*call)(const void* body, std::size_t i);
    void operator()(std::size_t i) const { call(body, i); }
  };
  struct Loop;
  void run_loop(std::size_t count, BodyRef body);
  [[nodiscard]] Loop* loop_to_help() const;  // mutex held
  void start_workers();
  void work(const std::stop_token& stop, int index);

  std::atomic<int> threads_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::condition_variable_any resting_;  // workers beyond threads_, which wake_ must not meet
  std::deque<std::function<void()>> tasks_;
  std::vector<Loop*> loops_;  // loops with indices left, oldest first; owned by their callers
  std::vector<std::jthread> workers_;
};

}  // namespace catgs
