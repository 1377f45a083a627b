// Takes the place of render_core/base/thread_pool.cpp in the fuzzer: a worker starts when the
// machine lets it, and what it ran by then would count as reached by the input of that moment, on
// one machine and not on the next.
#include "render_core/base/thread_pool.h"

namespace catgs {

int processors() { return 1; }

ThreadPool::ThreadPool(int /*threads*/) : threads_(1) {}
ThreadPool::~ThreadPool() = default;

void ThreadPool::run_loop(std::size_t count, BodyRef body) {
  for (std::size_t i = 0; i < count; ++i) body(i);
}

}  // namespace catgs
