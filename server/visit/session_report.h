#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/visit/session.h"

namespace catgs {

/// One session's entry in /api/sessions. Capturing it is cheap, because the session thread is busy
/// with frames. The reader's thread formats it.
struct SessionReport {
  explicit SessionReport(Session& session);

  std::string id;
  std::string_view state;
  bool paused;
  std::size_t spectators;
  std::string scene_id;
  StreamConfig config;
  std::optional<int> device;
  std::optional<EncoderEffort> effort;  // of libx264
  std::uint64_t frames_sent;
  std::uint64_t frames_dropped;
  std::uint64_t bytes_sent;
  int frames_in_flight;
  int credit;
  std::chrono::microseconds base_rtt;
  std::chrono::microseconds queue_delay;
  int target_bitrate_kbps;
  std::size_t steps_down;
  LinkState link;
  std::size_t frames_queued = 0;
  SessionUsage usage;
};

/// Publishes all sessions to Prometheus and /api/sessions.
class SessionReports {
 public:
  /// Session thread. Call it four times a second.
  void publish(const SessionList& sessions, const std::vector<EncoderChoice>& encoders,
               Metrics& metrics);
  /// Any thread. Returns the last publication as a JSON array.
  [[nodiscard]] std::string json() const;

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const std::vector<SessionReport>> published_;
};

}  // namespace catgs
