#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

namespace catgs {

/// Those who wait because all places are taken: first come, first served, and no more than a limit.
/// Pure; not thread-safe.
class AdmissionQueue {
 public:
  explicit AdmissionQueue(int limit) : limit_(static_cast<std::size_t>(limit)) {}

  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  [[nodiscard]] std::size_t size() const { return waiting_.size(); }
  [[nodiscard]] const std::string& front() const { return waiting_.front(); }

  /// 1 for the first; nothing: the queue is full. Who waits already keeps the position.
  std::optional<int> join(const std::string& session_id);
  /// Gives up or was admitted; who does not wait does nothing.
  void leave(std::string_view session_id);

  /// A session ended after this time: what estimates are made of.
  void session_ended(std::chrono::duration<double> lifetime);
  /// With `places` sessions of the mean lifetime one ends every lifetime / places. `position` of
  /// them have to.
  [[nodiscard]] std::chrono::seconds estimate(int position, int places) const;

 private:
  const std::size_t limit_;
  std::deque<std::string> waiting_;  // session ids
  // Of the last few dozens of sessions; a first guess until some have ended.
  std::chrono::duration<double> mean_lifetime_{std::chrono::minutes(5)};
};

}  // namespace catgs
