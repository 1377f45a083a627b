#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace catgs {

/// One upload's slot, held by its connection and by everything that keeps the body in memory.
class UploadSlot {
 public:
  /// The connection was closed, so nobody waits for the answer any more.
  void abandon() { abandoned_ = true; }
  [[nodiscard]] bool abandoned() const { return abandoned_; }

 private:
  std::atomic<bool> abandoned_{false};
};

/// Bounds the uploads in memory. A slot is free again when its last holder is gone. Thread-safe.
class UploadSlots {
 public:
  struct Bounds {
    std::size_t all;
    std::size_t of_a_link;  // so that one link or one address cannot block the others
    std::size_t of_an_address;
  };
  static constexpr Bounds small{4, 2, 3};
  static constexpr Bounds large{2, 1, 1};  // for bodies of more than max_upload_bytes

  explicit UploadSlots(const Bounds& bounds) : bounds_(bounds) {}

  /// Returns null if no slot is free. `link` is the sender's token.
  std::shared_ptr<UploadSlot> take(const std::string& link, const std::string& address);
  [[nodiscard]] std::size_t taken() const;

 private:
  struct Taken {
    std::string link;
    std::string address;
    std::weak_ptr<const UploadSlot> slot;
  };

  const Bounds bounds_;
  mutable std::mutex mutex_;
  std::vector<Taken> taken_;  // may hold freed slots; take() removes them
};

}  // namespace catgs
