#pragma once

#include <chrono>
#include <cstdint>
#include <deque>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// How many frames may be between this server and a client's screen. A frame in flight has been
/// sent and is neither presented nor dropped; a new one is worth rendering while
///   in_flight < clamp(ceil(base_rtt / frame_interval) + 1, 1, 8):
/// enough to fill the pipe, too little to build a queue in it. base_rtt is the least time from send
/// to acknowledgement over the last five to ten seconds, decoding and display included, because
/// the client acknowledges what it has shown. Pure; not thread-safe.
class CreditWindow {
 public:
  explicit CreditWindow(std::chrono::microseconds frame_interval)
      : frame_interval_(frame_interval) {}

  void set_frame_interval(std::chrono::microseconds interval) { frame_interval_ = interval; }
  void sent(std::uint64_t frame_id, TimePoint now);
  /// The frame was dropped before it reached the socket.
  void lost(std::uint64_t frame_id);
  /// A presented frame also settles all older ones: the newest wins, so they will never be shown.
  /// False: the frame is not in flight (settled already, or never sent).
  bool acknowledged(std::uint64_t frame_id, bool dropped, TimePoint now);
  /// Forgets what is in flight: the client says that it shows nothing at the moment.
  void reset() { in_flight_.clear(); }

  [[nodiscard]] int in_flight() const { return static_cast<int>(in_flight_.size()); }
  [[nodiscard]] int limit() const;
  [[nodiscard]] bool available() const { return in_flight() < limit(); }
  [[nodiscard]] std::chrono::microseconds base_rtt() const;  // 0: not known yet

 private:
  struct InFlight {
    std::uint64_t frame_id;
    TimePoint sent;
  };
  void measure(std::chrono::microseconds rtt, TimePoint now);

  std::chrono::microseconds frame_interval_;
  std::deque<InFlight> in_flight_;  // by frame_id
  // Least RTT of the running span of five seconds and of the one before; 0: none.
  std::chrono::microseconds span_min_{0};
  std::chrono::microseconds previous_span_min_{0};
  TimePoint span_start_{};
};

}  // namespace catgs
