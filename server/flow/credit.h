#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "server/base/clock.h"
#include "server/base/running_minimum.h"

namespace catgs {

/// Limits the frames and bytes in flight between this server and a client's screen. A frame in
/// flight was sent, but neither presented nor dropped. A new frame is worth rendering while both
/// bounds hold:
/// - frames: in_flight < clamp(ceil(usual_rtt / frame_interval) + 1, 1, 8). This fills the pipe
///   without building a queue.
/// - bytes: those in flight fit what the link carries in usual_rtt + frame_interval + slack. Behind
///   a few large frames on a slow link, a small one would only queue.
///
/// base_rtt is the least time from send to acknowledgement over the last five to ten seconds. It
/// includes decoding and display, because the client acknowledges presented frames. usual_rtt is
/// base_rtt plus the mean excess of round trips (jitter, display refresh), at most two frame
/// intervals. Without the excess, jitter would cost frames; without its bound, it would grow with
/// the queue. Pure; not thread-safe.
class CreditWindow {
 public:
  struct InFlight {
    std::uint64_t frame_id = 0;
    std::size_t bytes = 0;
    std::size_t pixels = 0;  // for the decoder's rate
    TimePoint sent;
    bool still = false;  // large on purpose
  };
  /// The frames that one acknowledgement settles.
  struct Settled {
    InFlight frame;         // the one that was acknowledged
    std::size_t bytes = 0;  // of all settled frames
    std::size_t pixels = 0;
    std::chrono::microseconds round_trip{0};
  };

  explicit CreditWindow(std::chrono::microseconds frame_interval)
      : frame_interval_(frame_interval) {}

  void set_frame_interval(std::chrono::microseconds interval) { frame_interval_ = interval; }
  /// The rate of the link; none: not known, so that bytes are not bounded.
  void set_link_rate(std::optional<double> bits_per_s) { bits_per_s_ = bits_per_s; }
  void sent(const InFlight& frame);
  /// The frame was dropped before it reached the socket.
  void lost(std::uint64_t frame_id);
  /// A presented frame also settles all older ones, because the client never shows them any more.
  /// Returns nothing if the frame is not in flight: never sent, or settled already.
  std::optional<Settled> acknowledged(std::uint64_t frame_id, bool dropped, TimePoint now);
  /// Forgets all frames in flight: the client shows nothing at the moment.
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
  double excess_us_ = 0.0;  // round trips over the least one, smoothed
};

}  // namespace catgs
