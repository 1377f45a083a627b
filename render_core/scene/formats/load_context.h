#pragma once

#include <cstddef>
#include <functional>
#include <utility>

#include "render_core/base/thread_pool.h"

namespace catgs {

/// Arguments of every reader besides its bytes: threads, and a receiver of progress.
class LoadContext {
 public:
  explicit LoadContext(ThreadPool& pool, std::function<void(double)> progress = {})
      : pool_(pool), progress_(std::move(progress)) {}

  /// Calls body(begin, end) for consecutive ranges of at most `block` of the indices [0, count), on
  /// several threads, and reports progress as they end, 1 at last. Unlike with
  /// ThreadPool::parallel_for, `body` may throw. The exception of the first failing range is
  /// rethrown here after the others have ended or been skipped.
  void for_blocks(std::size_t count, std::size_t block,
                  const std::function<void(std::size_t begin, std::size_t end)>& body) const;

  /// `fraction` in 0…1 of this context's share of the work. Call from the loading thread.
  void report(double fraction) const {
    if (progress_) progress_(fraction);
  }

  /// A context whose progress is the part [from, to] of this one's.
  [[nodiscard]] LoadContext part(double from, double to) const;

 private:
  ThreadPool& pool_;
  std::function<void(double)> progress_;
};

}  // namespace catgs
