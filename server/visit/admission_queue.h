#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/clock.h"

namespace catgs {

/// A bounded queue, first in, first out, of sessions that wait for a slot. Pure; not thread-safe.
class AdmissionQueue {
 public:
  explicit AdmissionQueue(int limit) : limit_(static_cast<std::size_t>(limit)) {}

  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  [[nodiscard]] std::size_t size() const { return waiting_.size(); }
  struct Waiting {
    std::string session_id;
    TimePoint since;
  };
  /// Returns a copy in queue order, because a session that is asked may leave the queue.
  [[nodiscard]] std::vector<Waiting> waiting() const { return {waiting_.begin(), waiting_.end()}; }

  /// Returns the position, 1 for the first, or nothing if the queue is full. A session that waits
  /// already keeps its position.
  std::optional<int> join(const std::string& session_id, TimePoint now);
  /// The session gives up or was admitted. Nothing happens if it does not wait.
  void leave(std::string_view session_id);

  /// Records the lifetime of a session that ended. Estimates are made from the mean.
  void session_ended(std::chrono::duration<double> lifetime);
  /// The expected wait at `position`. With `slots` sessions, one ends every mean lifetime /
  /// `slots` on average.
  [[nodiscard]] std::chrono::seconds estimate(int position, int slots) const;

 private:
  const std::size_t limit_;
  std::deque<Waiting> waiting_;
  // The mean over the last few dozen sessions; a first guess until some have ended.
  std::chrono::duration<double> mean_lifetime_{std::chrono::minutes(5)};
};

}  // namespace catgs
