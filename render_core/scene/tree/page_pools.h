#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>

#include "render_core/scene/tree/page_pool.h"

namespace catgs {

/// The pools of pages of all Renderers that share it: one on each device, and one in main memory. A
/// pool comes with the first tree on its device and goes with the last. Thread-safe.
class PagePools {
 public:
  /// In place of a device: main memory.
  static constexpr int host = -1;
  /// Others wait for frames that wait for pages. So many turns read about 0.5 GB.
  static constexpr int settling_turns = 16;

  /// `memory_bytes`: of each pool.
  explicit PagePools(std::uint64_t memory_bytes) : memory_bytes_(memory_bytes) {}

  [[nodiscard]] std::uint64_t memory_bytes() const { return memory_bytes_; }
  /// The pool on a device. `make` makes it where there is none, and may throw.
  std::shared_ptr<PagePool> on(int device, const std::function<std::shared_ptr<PagePool>()>& make) {
    const std::lock_guard lock(mutex_);
    std::weak_ptr<PagePool>& known = pools_[device];
    if (auto pool = known.lock()) return pool;
    auto pool = make();
    known = pool;
    return pool;
  }

 private:
  const std::uint64_t memory_bytes_;
  std::mutex mutex_;
  std::map<int, std::weak_ptr<PagePool>> pools_;
};

}  // namespace catgs
