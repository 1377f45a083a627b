#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "server/base/clock.h"
#include "server/base/rate_limit.h"
#include "server/flow/flow_control.h"
#include "server/visit/frame_loop.h"
#include "server/visit/marker_visibility.h"
#include "server/visit/stream_control.h"
#include "server/visit/visit_host.h"
#include "server/visit/visit_life.h"
#include "server/visit/visit_policy.h"
#include "server/visit/visit_statistics.h"

namespace catgs {

/// One client's visit: hello -> admission, perhaps after a wait -> welcome -> poses, frames, acks
/// -> bye. While a lost client may return, all state is kept and nothing is rendered. A visit knows
/// no socket, thread or clock: events carry their time and effects go through the host.
/// StreamControl decides how frames are encoded; FrameLoop decides when they are due and what they
/// show. Not thread-safe.
class Visit {
 public:
  Visit(const VisitPolicy& policy, VisitHost& host, TimePoint now);
  Visit(const Visit&) = delete;  // its parts refer to its flow control

  void on_message(const ClientMessage& message, TimePoint now);
  void on_stream_opened(const StreamOpened& opened, TimePoint now);
  void on_frame(FrameResult result, TimePoint now);
  /// Call it at least four times a second. Handles timeouts, statistics and the heartbeat.
  /// `sessions`: of the server. `outdated`: the last picture would look better now.
  void on_tick(TimePoint now, int sessions = 1, bool outdated = false);
  /// Asks for admission again. Only while the visit waits for a slot.
  void ask_again(TimePoint now);
  /// The connection was lost without a farewell. The visit closes after the grace period.
  void on_lost(TimePoint now);
  /// The client has reconnected, perhaps with other requests. It gets a welcome, then an IDR.
  /// Requires resumable().
  void on_resumed(const Hello& hello, Admission admission, TimePoint now);

  /// Sends a message, unless the client is gone for good.
  void say(const ServerMessage& message, TimePoint now);
  /// Sends the error and closes.
  void fail(ErrorCode code, std::string_view message);
  /// Closes without a message.
  void end(std::string_view reason, CloseCode code = CloseCode::going_away);

  /// The next frame and when it may start; none: nothing to show or no credit.
  [[nodiscard]] std::optional<FrameCandidate> next_frame() const;
  /// Starts the frame that next_frame() announced. on_frame() ends it.
  FrameOrder start_frame(TimePoint now);

  [[nodiscard]] const VisitLife& life() const { return life_; }
  /// While queued: the client's hello, with the settings that it has sent since.
  [[nodiscard]] const Hello& waiting_hello() const { return hello_; }
  [[nodiscard]] StreamControl& stream() { return stream_; }
  [[nodiscard]] const StreamControl& stream() const { return stream_; }
  [[nodiscard]] FlowControl& flow() { return flow_; }
  [[nodiscard]] std::chrono::microseconds frame_interval() const { return frames_.interval(); }
  [[nodiscard]] VisitStatistics& statistics() { return statistics_; }

 private:
  /// Handles a message from an admitted client.
  void on_live_message(const ClientMessage& message, TimePoint now);
  /// False: a stream has to be opened first.
  bool begin(const Hello& hello, Admission admission, TimePoint now);
  void select(const std::string& scene_id, TimePoint now);
  /// Remembers the scene that is being loaded and tells the client how long that may take.
  void await_scene(const std::string& scene_id, const SceneAwaited& awaited, TimePoint now);

  const VisitPolicy& policy_;
  VisitHost& host_;
  VisitLife life_;
  Hello hello_;
  /// The scene that is awaited: not in memory yet, or selected too soon after another one. It comes
  /// from the hello or a live client's selection. Each tick asks for it.
  std::optional<std::string> awaited_scene_;
  std::optional<TimePoint> told_of_scene_;
  std::optional<TimePoint> selected_;
  TimePoint last_said_;
  RateLimit picks_;
  FlowControl flow_;
  StreamControl stream_;
  FrameLoop frames_;
  MarkerVisibility markers_;
  VisitStatistics statistics_;
};

}  // namespace catgs
