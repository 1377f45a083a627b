#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

namespace catgs::load {

/// The congestion window of a TCP sender with CUBIC, as Linux has it (RFC 9438, 5681, 6928): slow
/// start from ten segments, cubic growth or Reno's where that is faster, 0.7 of the window after a
/// loss, one segment after a timeout, and a restart after idle time. Not modelled: HyStart, pacing
/// and the undoing of a reduction. Counts segments. Pure: times are microseconds that never
/// decrease from call to call.
class TcpWindow {
 public:
  static constexpr double initial_segments = 10.0;

  /// A segment was sent. After an idle timeout, the window shrinks first.
  void sent(std::int64_t now_us);
  /// It has arrived, and its acknowledgement is back.
  void acked(std::int64_t sent_us, std::int64_t now_us);
  /// The sender notices that a segment was lost. Losses of one round trip count once.
  void lost(std::int64_t sent_us, std::int64_t now_us);
  /// No acknowledgement has come in time.
  void timed_out(std::int64_t now_us);

  [[nodiscard]] double segments() const { return window_; }
  [[nodiscard]] double in_flight() const { return in_flight_; }
  [[nodiscard]] bool slow_start() const { return window_ < threshold_; }
  /// How long the sender waits for an acknowledgement.
  [[nodiscard]] std::int64_t timeout_us() const;

 private:
  void restart_after_idle(std::int64_t now_us);
  void reduce();
  /// Whether the window was what held the sender back, in this round trip or the last.
  [[nodiscard]] bool used() const;
  void grow_by_cubic(std::int64_t now_us);

  double window_ = initial_segments;
  double threshold_ = std::numeric_limits<double>::infinity();  // where slow start ends
  double in_flight_ = 0.0;
  double largest_ = 0.0;        // window at the last loss: CUBIC's W_max
  std::int64_t epoch_us_ = -1;  // when the cubic growth began; -1: it has not
  double plateau_s_ = 0.0;      // from then until the window is `origin_` again: CUBIC's K
  double origin_ = 0.0;
  double reno_ = 0.0;          // what Reno's window would be
  double round_trip_s_ = 0.0;  // smoothed
  std::int64_t last_sent_us_ = -1;
  std::int64_t reduced_us_ = -1;           // losses of what was sent before are known
  std::int64_t round_us_ = 0;              // when the present round trip began
  double peak_ = 0.0, last_peak_ = 0.0;    // most in flight in this round trip and the one before
  bool full_ = false, last_full_ = false;  // nothing more could be sent, in the same
};

}  // namespace catgs::load
