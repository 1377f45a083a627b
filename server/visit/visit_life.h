#pragma once

#include <chrono>
#include <optional>

#include "server/base/clock.h"
#include "server/net/messages.h"
#include "server/visit/visit_policy.h"

namespace catgs {

enum class VisitState { awaiting_hello, queued, opening, live, closed };

/// The state of a visit between connection and end: its phase, whether its client looks, and its
/// timeouts. Pure; not thread-safe.
class VisitLife {
 public:
  VisitLife(const VisitPolicy& policy, TimePoint now)
      : policy_(policy), created_(now), last_activity_(now) {}

  void enter(VisitState state) { state_ = state; }
  /// Restarts the idle timeout and its warning.
  void note_activity(TimePoint now) {
    last_activity_ = now;
    idle_warned_ = false;
  }
  void pause(bool paused) { paused_ = paused; }
  void lose(TimePoint now) { lost_at_ = now; }
  /// Requires resumable(). A page that is still hidden says so again.
  void resume(TimePoint now);

  [[nodiscard]] VisitState state() const { return state_; }
  [[nodiscard]] bool resumable() const {
    return state_ == VisitState::opening || state_ == VisitState::live;
  }
  [[nodiscard]] bool lost() const { return lost_at_.has_value(); }
  [[nodiscard]] bool paused() const { return paused_; }
  /// True: the client is live, connected and not paused.
  [[nodiscard]] bool on_show() const { return state_ == VisitState::live && !lost_at_ && !paused_; }
  /// True: on show, and the visitor has been inactive for a while. The time is longer than that of
  /// Rest, which decides about stills.
  [[nodiscard]] bool rests(TimePoint now) const {
    constexpr std::chrono::milliseconds a_while{500};
    return state_ == VisitState::live && now - last_activity_ >= a_while;
  }

  [[nodiscard]] bool hello_is_late(TimePoint now) const {
    return state_ == VisitState::awaiting_hello && now - created_ >= policy_.hello_timeout;
  }
  /// True: a lost client did not come back in time.
  [[nodiscard]] bool grace_is_over(TimePoint now) const {
    return held_for(lost_at_, policy_.resume_grace, now);
  }
  /// The message for an idle client, if any: first a warning, then the fatal error.
  std::optional<ErrorMessage> idle_message(TimePoint now);

 private:
  const VisitPolicy& policy_;
  const TimePoint created_;
  VisitState state_ = VisitState::awaiting_hello;
  TimePoint last_activity_;
  bool idle_warned_ = false;
  std::optional<TimePoint> lost_at_;
  bool paused_ = false;
};

}  // namespace catgs
