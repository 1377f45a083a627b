#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// Those who wait because all places are taken, in the order in which they came, and no more than a
/// limit. Pure; not thread-safe.
class AdmissionQueue {
 public:
  explicit AdmissionQueue(int limit) : limit_(static_cast<std::size_t>(limit)) {}

  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  [[nodiscard]] std::size_t size() const { return waiting_.size(); }
  struct Waiting {
    std::string session_id;
    TimePoint since;
  };
  /// A copy, first come first: those who are asked may leave the queue.
  [[nodiscard]] std::vector<Waiting> waiting() const { return {waiting_.begin(), waiting_.end()}; }

  /// Returns the position, 1 for the first, or nothing if the queue is full. A session that waits
  /// already keeps its position.
  std::optional<int> join(const std::string& session_id, TimePoint now);
  /// The session gives up or was admitted. Nothing happens if it does not wait.
  void leave(std::string_view session_id);

  /// A session ended after this time: what estimates are made of.
  void session_ended(std::chrono::duration<double> lifetime);
  /// With `places` sessions of the mean lifetime one ends every lifetime / places. `position` of
  /// them have to.
  [[nodiscard]] std::chrono::seconds estimate(int position, int places) const;

 private:
  const std::size_t limit_;
  std::deque<Waiting> waiting_;
  // Of the last few dozens of sessions; a first guess until some have ended.
  std::chrono::duration<double> mean_lifetime_{std::chrono::minutes(5)};
};

}  // namespace catgs
