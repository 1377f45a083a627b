#pragma once

#include <cassert>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <vector>

namespace catgs {

/// The slots of a pool that no page has, and the bell that wakes the pool's thread. Tables give
/// slots back when they go, on any thread, and even after the pool.
class FreeSlots {
 public:
  explicit FreeSlots(std::uint32_t slots) {
    for (std::uint32_t slot = slots; slot-- > 0;) free_.push_back(slot);
  }
  [[nodiscard]] std::uint32_t count() const {
    const std::lock_guard lock(mutex_);
    return static_cast<std::uint32_t>(free_.size());
  }
  /// One must be free.
  std::uint32_t take() {
    const std::lock_guard lock(mutex_);
    assert(!free_.empty());
    const std::uint32_t slot = free_.back();
    free_.pop_back();
    return slot;
  }
  void give_back(std::uint32_t slot) {
    const std::lock_guard lock(mutex_);
    free_.push_back(slot);
    rung_ = rung_ || awaited_;
    bell_.notify_all();
  }
  /// Whether slots that come back ring the bell. `seen`: an earlier count(), beyond which slots
  /// have come back since.
  void await(bool awaited, std::uint32_t seen) {
    const std::lock_guard lock(mutex_);
    awaited_ = awaited;
    rung_ = rung_ || (awaited && free_.size() > seen);
  }
  /// Waits for a free slot. False: none came in time.
  [[nodiscard]] bool wait_for_one(std::chrono::milliseconds most) {
    std::unique_lock lock(mutex_);
    return bell_.wait_for(lock, most, [this] { return !free_.empty(); });
  }

  void ring() {
    const std::lock_guard lock(mutex_);
    rung_ = true;
    bell_.notify_all();
  }
  /// Waits until the bell has rung since the last hush(), or for `stop`.
  void listen(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    bell_.wait(lock, stop, [this] { return rung_; });
  }
  void hush() {
    const std::lock_guard lock(mutex_);
    rung_ = false;
  }
  void pause(const std::stop_token& stop, std::chrono::steady_clock::time_point until) {
    std::unique_lock lock(mutex_);
    bell_.wait_until(lock, stop, until, [] { return false; });
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable_any bell_;
  std::vector<std::uint32_t> free_;
  bool rung_ = false, awaited_ = false;
};

}  // namespace catgs
