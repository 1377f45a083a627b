#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "server/pipeline/frame_ticket.h"
#include "server/session/running_minimum.h"

namespace catgs {

/// How many frames, and how many of their bytes, may be between this server and a client's screen.
/// A frame in flight has been sent and is neither presented nor dropped; a new one is worth
/// rendering while
///   in_flight < clamp(ceil(usual_rtt / frame_interval) + 1, 1, 8):
/// enough to fill the pipe, too little to build a queue in it, and while the bytes in flight fit
/// what the link carries in usual_rtt + frame_interval + slack: behind a few large frames on a link
/// that has become slow, a small one would only queue. usual_rtt is base_rtt and what round trips
/// take longer on average (jitter, a display that refreshes later), two frame intervals at most:
/// with the least alone a link with jitter would go without frames at times, and an unbounded
/// average would grow with the queue. base_rtt is the least time from send to acknowledgement over
/// the last five to ten seconds, decoding and display included, because the client acknowledges
/// what it has shown. Pure; not thread-safe.
class CreditWindow {
 public:
  struct InFlight {
    std::uint64_t frame_id = 0;
    std::size_t bytes = 0;
    std::size_t pixels = 0;  // that its decoder is judged by
    TimePoint sent;
    bool still = false;  // large on purpose
  };
  /// What an acknowledgement settles.
  struct Settled {
    InFlight frame;         // the one that was acknowledged
    std::size_t bytes = 0;  // of all that it settles
    std::size_t pixels = 0;
    std::chrono::microseconds round_trip{0};
  };

  explicit CreditWindow(std::chrono::microseconds frame_interval)
      : frame_interval_(frame_interval) {}

  void set_frame_interval(std::chrono::microseconds interval) { frame_interval_ = interval; }
  /// What the link carries; none: not known, so that bytes are no bound.
  void set_link_rate(std::optional<double> bits_per_s) { bits_per_s_ = bits_per_s; }
  void sent(const InFlight& frame);
  /// The frame was dropped before it reached the socket.
  void lost(std::uint64_t frame_id);
  /// A presented frame also settles all older ones: the newest wins, so they will never be shown.
  /// Nothing: the frame is not in flight (settled already, or never sent).
  std::optional<Settled> acknowledged(std::uint64_t frame_id, bool dropped, TimePoint now);
  /// Forgets what is in flight: the client says that it shows nothing at the moment.
  void reset() { in_flight_.clear(); }

  [[nodiscard]] int in_flight() const { return static_cast<int>(in_flight_.size()); }
  [[nodiscard]] std::size_t bytes_in_flight() const;
  [[nodiscard]] int limit() const;
  [[nodiscard]] bool available() const;
  [[nodiscard]] std::chrono::microseconds base_rtt() const;  // 0: not known yet

 private:
  [[nodiscard]] std::chrono::microseconds usual_rtt() const;

  std::chrono::microseconds frame_interval_;
  std::optional<double> bits_per_s_;
  std::deque<InFlight> in_flight_;  // by frame_id
  RunningMinimum rtt_us_;
  double excess_us_ = 0.0;  // of round trips over the least, smoothed
};

}  // namespace catgs
