#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace catgs {

/// One upload's place, held by its connection and by everything that keeps the body in memory.
class UploadPlace {
 public:
  /// The connection was closed, so nobody waits for the answer any more.
  void abandon() { abandoned_ = true; }
  [[nodiscard]] bool abandoned() const { return abandoned_; }

 private:
  std::atomic<bool> abandoned_{false};
};

/// Bounds the uploads in memory. A place is free again when its last holder is gone. Thread-safe.
class UploadPlaces {
 public:
  static constexpr std::size_t places = 4;
  static constexpr std::size_t places_of_a_link = 2;  // so that one link cannot block the others
  // For bodies of more than max_upload_bytes.
  static constexpr std::size_t large_places = 2;
  static constexpr std::size_t large_places_of_a_link = 1;

  explicit UploadPlaces(std::size_t most = places, std::size_t most_of_a_link = places_of_a_link)
      : most_(most), most_of_a_link_(most_of_a_link) {}

  /// Returns null if no place is free. `link` is the sender's Authorization header.
  std::shared_ptr<UploadPlace> take(const std::string& link);
  [[nodiscard]] std::size_t taken() const;

 private:
  struct Taken {
    std::string link;
    std::weak_ptr<const UploadPlace> place;
  };

  const std::size_t most_;
  const std::size_t most_of_a_link_;
  mutable std::mutex mutex_;
  std::vector<Taken> taken_;  // may hold freed places; take() removes them
};

}  // namespace catgs
