#pragma once

#include <string>
#include <vector>

#include "server/session/client.h"

namespace catgs {

/// What /api/sessions tells of one session. Taking it down is quick, as the session thread has
/// frames to give; whoever asks makes the text of it.
struct SessionReport {
  explicit SessionReport(const Client& client);

  std::string id;
  std::string_view state;
  bool paused;
  std::size_t spectators;
  std::string scene_id;
  StreamConfig config;
  std::optional<int> device;
  EncoderKind encoder;
  EncoderEffort effort;
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
  std::size_t frames_queued;
  SessionUsage usage;
};

/// A JSON array.
std::string to_json(const std::vector<SessionReport>& reports);

}  // namespace catgs
