#include "render_core/scene/formats/load_context.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>

namespace catgs {

void LoadContext::for_blocks(std::size_t count, std::size_t block,
                             const std::function<void(std::size_t, std::size_t)>& body) const {
  assert(block > 0);
  const std::size_t blocks = (count + block - 1) / block;
  const auto loading_thread = std::this_thread::get_id();
  std::atomic<std::size_t> ended{0};
  std::mutex mutex;
  std::atomic<std::size_t> failed_block{std::numeric_limits<std::size_t>::max()};
  std::exception_ptr failure;
  const auto fail = [&](std::size_t b) {
    const std::lock_guard lock(mutex);
    if (b >= failed_block) return;
    failed_block = b;
    failure = std::current_exception();
  };

  pool_.parallel_for(blocks, [&](std::size_t b) {
    if (b > failed_block) return;
    try {
      body(b * block, std::min(count, (b + 1) * block));
      const std::size_t done = ++ended;
      if (std::this_thread::get_id() == loading_thread)
        report(static_cast<double>(done) / static_cast<double>(blocks));
    } catch (...) {
      fail(b);
    }
  });
  if (failure) std::rethrow_exception(failure);
  report(1.0);  // the other threads may have run every block
}

LoadContext LoadContext::part(double from, double to) const {
  assert(from >= 0.0 && from <= to && to <= 1.0);
  if (!progress_) return LoadContext(pool_);
  return LoadContext(pool_, [outer = progress_, from, to](double fraction) {
    outer(from + (to - from) * fraction);
  });
}

}  // namespace catgs
