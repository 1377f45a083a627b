#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "tests/load/tcp_window.h"

namespace catgs::load {

/// From `from_us` on, the link carries `bits_per_s`; 0: an outage.
struct RateStep {
  std::int64_t from_us = 0;
  double bits_per_s = 0.0;
};

/// Rates over the time since the run began, in time order, the first at 0. Empty: no limit.
using RateSchedule = std::vector<RateStep>;

/// A client's line, as a TCP connection over it sees it: bytes are late, never lost or reordered.
struct LinkSettings {
  std::string text;                 // as it was written
  RateSchedule down, up;            // server to client, client to server
  std::int64_t delay_us = 0;        // one way
  std::int64_t jitter_us = 0;       // further delay of each segment, uniform in 0…jitter
  double loss = 0.0;                // share of segments lost
  double burst = 1.0;               // segments lost in a row, mean
  std::int64_t queue_us = 200'000;  // what the bottleneck buffers, at its rate of the moment
  bool cubic = true;                // the sender has CUBIC's congestion window; false: none

  /// Whether it differs from no link at all.
  [[nodiscard]] bool shapes() const {
    return !down.empty() || !up.empty() || delay_us > 0 || jitter_us > 0 || loss > 0.0;
  }
};

/// Rates of a phone that moves through a 4G network: 1,200 steps of 500 ms. Their logarithm is an
/// autoregressive process with a median of 12 Mbit/s, a standard deviation of 0.8 and a correlation
/// time of 5 s. Handovers, 25 s apart on average, leave 0.5 Mbit/s for 0.5 to 1.5 s.
RateSchedule mobile_rates(std::uint64_t seed);

/// "rate=50mbit@0s,5mbit@10s,up=5mbit,delay=20ms,jitter=5ms,loss=1%,burst=4,queue=300ms,congestion=cubic";
/// "rate=4g:SEED" is mobile_rates(). `up` is as `rate` where it is not given. Throws InputError
/// that names `source` and the key.
LinkSettings parse_link(std::string_view source, std::string_view text);

/// One direction of a link. Pure: times are microseconds since the run began, and never decrease
/// from call to call.
///
/// A segment leaves the bottleneck when the rate has carried all bytes before it and its own, and
/// arrives after delay and jitter, behind its predecessors. A lost one arrives when TCP has
/// repeated it, and what follows waits for it: a round trip later, or after three lost in a row the
/// retransmission timeout. The sender has no more under way than its congestion window, which it
/// reduces for a loss. Whatever the window allows beyond the bottleneck's buffer costs a loss, too.
class LinkShaper {
 public:
  LinkShaper(const LinkSettings& link, RateSchedule rate, std::uint64_t seed);

  /// Bytes that window and buffer still take. Whoever has more has to wait, as before a socket.
  [[nodiscard]] std::size_t room_bytes(std::int64_t now_us);
  /// When there will be room again.
  [[nodiscard]] std::int64_t next_room_us() const;
  /// Takes a segment and returns when it arrives at the far end.
  std::int64_t send(std::size_t bytes, std::int64_t now_us);

  [[nodiscard]] const TcpWindow& window() const { return window_; }

  static constexpr std::size_t segment_bytes = 1448;  // Ethernet's, less IP and TCP headers
  static constexpr std::int64_t never_us = std::int64_t{1} << 52;

 private:
  struct Departure {
    std::int64_t time_us = 0;
    std::size_t bytes = 0;
  };
  /// The sender's knowledge.
  struct Notice {
    enum class Kind { acked, lost, timed_out } kind = Kind::acked;
    std::int64_t sent_us = 0;
  };
  [[nodiscard]] double rate_at(std::int64_t time_us) const;
  /// When the bottleneck has carried `bytes` from `begin_us` on.
  [[nodiscard]] std::int64_t carried_at(std::int64_t begin_us, std::size_t bytes) const;
  void forget_departed(std::int64_t now_us);
  /// Tells the window what the sender knows by now.
  void notice(std::int64_t now_us);
  [[nodiscard]] std::size_t buffer_room_bytes(std::int64_t now_us) const;
  /// The delay by the loss of a segment; 0: it is not lost.
  std::int64_t recovery_us(std::int64_t queueing_us);

  LinkSettings link_;
  RateSchedule rate_;
  std::minstd_rand random_;
  std::deque<Departure> queue_;  // in the bottleneck's buffer
  std::size_t queued_bytes_ = 0;
  std::int64_t last_departure_us_ = 0;
  std::int64_t last_arrival_us_ = 0;
  int lost_in_a_row_ = 0;
  bool windowed_ = false;
  TcpWindow window_;
  std::multimap<std::int64_t, Notice> notices_;  // by time
  bool overflows_ = false;                       // the buffer loses the next segment
  std::int64_t overflow_known_us_ = 0;           // the sender knows of the last one from then on
};

}  // namespace catgs::load
