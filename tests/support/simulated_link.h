#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <vector>

#include "server/net/messages.h"
#include "server/pipeline/frame_ticket.h"

namespace catgs::test {

/// From `at` on, until the next one.
struct LinkRate {
  std::chrono::microseconds at{0};
  double bits_per_s = 0.0;
};

/// A time without: the network delivers nothing, or the client's device sleeps.
struct Outage {
  std::chrono::microseconds from{0};
  std::chrono::microseconds to{0};
};

struct LinkPlan {
  std::vector<LinkRate> rates{{std::chrono::microseconds(0), 50e6}};
  std::chrono::microseconds delay{10'000};  // each way
  std::chrono::microseconds jitter{0};      // on top, evenly spread; order is kept, as TCP does
  /// TCP waits for a retransmission: what was sent meanwhile arrives together at the end.
  std::vector<Outage> stalls;
  std::size_t queue_bytes = 1u << 20;  // in the network; the rest waits in the sender's socket
};

/// One direction of a TCP connection through a bottleneck, in simulated time since its start.
/// Deterministic.
class SimulatedLink {
 public:
  explicit SimulatedLink(LinkPlan plan) : plan_(std::move(plan)) {}

  /// When the last byte of a message arrives that is handed over at `now`.
  std::chrono::microseconds send(std::size_t bytes, std::chrono::microseconds now);
  /// What still waits in the sender's socket.
  [[nodiscard]] std::size_t unsent_bytes(std::chrono::microseconds now) const;

 private:
  [[nodiscard]] std::chrono::microseconds when_sent(double bits,
                                                    std::chrono::microseconds start) const;
  [[nodiscard]] double bits_between(std::chrono::microseconds from,
                                    std::chrono::microseconds to) const;

  LinkPlan plan_;
  std::chrono::microseconds free_at_{0};
  std::chrono::microseconds last_arrival_{0};
  std::minstd_rand random_{1};
};

struct ClientPlan {
  double decode_s_per_megapixel = 0.002;
  std::chrono::microseconds refresh{16'667};
  std::vector<Outage> sleeps;
  std::chrono::microseconds clock_ahead{777'000'000};  // of the server's clock
};

/// A client as the browser's is: decodes in order, shows the newest decoded picture at each refresh
/// of its display, acknowledges what it showed and what it did not. Simulated time, deterministic.
class SimulatedClient {
 public:
  explicit SimulatedClient(ClientPlan plan) : plan_(std::move(plan)) {}

  void receive(const FrameTicket& ticket, std::chrono::microseconds arrival);
  /// Acknowledgements that it sends until `now`, in order.
  std::vector<Ack> acknowledge(std::chrono::microseconds now);
  [[nodiscard]] std::int64_t clock_us(std::chrono::microseconds now) const {
    return (now + plan_.clock_ahead).count();
  }
  [[nodiscard]] bool asleep(std::chrono::microseconds now) const;

 private:
  struct Decoded {
    FrameTicket ticket;
    std::chrono::microseconds received;
    std::chrono::microseconds decoded;
  };
  [[nodiscard]] Ack ack_of(const Decoded& frame, std::optional<std::chrono::microseconds> shown);

  ClientPlan plan_;
  std::chrono::microseconds decoder_free_at_{0};
  std::chrono::microseconds next_refresh_{0};
  std::deque<Decoded> frames_;
};

}  // namespace catgs::test
