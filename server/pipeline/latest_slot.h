#pragma once

#include <mutex>
#include <optional>
#include <utility>

namespace catgs {

/// A queue of length one in which the newest value wins: between a producer that must not wait and
/// a consumer that wants nothing stale. Thread-safe.
template <typename T>
class LatestSlot {
 public:
  /// True: the slot was empty, so the consumer has to be woken.
  bool store(T value) {
    const std::lock_guard lock(mutex_);
    const bool was_empty = !value_;
    value_ = std::move(value);
    return was_empty;
  }

  std::optional<T> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(value_, std::nullopt);
  }

 private:
  std::mutex mutex_;
  std::optional<T> value_;
};

}  // namespace catgs
