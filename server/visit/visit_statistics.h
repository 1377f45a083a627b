#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "render_core/frame/renderer.h"
#include "server/base/clock.h"
#include "server/flow/flow_control.h"
#include "server/net/messages.h"

namespace catgs {

/// Counts what a visit's client was sent, in total and since the last Stats message. Not
/// thread-safe.
class VisitStatistics {
 public:
  explicit VisitStatistics(TimePoint now) : second_start_(now) {}

  /// A frame left through the socket. Only now does it count as sent.
  void frame_sent(std::size_t bytes);
  /// A frame was drawn, not only refined. `device_s`: time of a GPU; 0 on the CPU core.
  void frame_drawn(const FrameStats& frame, double device_s);
  /// A frame of a scene in pages was drawn.
  void pages_drawn(const FrameStats& frame, float detail_px);
  /// Frames were dropped before they reached the socket.
  void frames_lost(std::size_t count);
  void frame_dropped_by_client() { ++frames_dropped_; }
  /// The Stats message, once a second while frames are sent. `sessions` counts all sessions of the
  /// server.
  std::optional<Stats> take(const FlowControl& flow, int sessions, TimePoint now);

  [[nodiscard]] std::uint64_t frames_sent() const { return frames_sent_; }
  [[nodiscard]] std::uint64_t frames_dropped() const { return frames_dropped_; }
  [[nodiscard]] std::uint64_t bytes_sent() const { return bytes_sent_; }

 private:
  TimePoint second_start_;
  std::uint32_t second_frames_ = 0;
  std::uint64_t second_bytes_ = 0;
  std::uint32_t second_drawn_ = 0, second_keys_ = 0;  // frames, and key frames among them
  double second_device_s_ = 0.0;
  Stats stats_;

  std::uint64_t frames_sent_ = 0;
  std::uint64_t frames_dropped_ = 0;
  std::uint64_t bytes_sent_ = 0;
};

}  // namespace catgs
