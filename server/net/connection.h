#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// WebSocket close codes (RFC 6455, 7.4.1) that this server sends.
enum class CloseCode : std::uint16_t {
  normal = 1000,
  going_away = 1001,
  unsupported_data = 1003,
  policy_violation = 1008,
  too_big = 1009,
  service_restart = 1012,  // it takes nobody in any more
  try_again_later = 1013,
};

/// The kernel's view of the path to the peer, which may be a proxy.
struct LinkState {
  std::uint32_t rtt_us = 0;               // smoothed
  std::uint64_t delivery_bits_per_s = 0;  // measured lately; a lower bound of what is possible
  std::uint32_t window_bytes = 0;         // congestion window
  std::uint32_t unsent_bytes = 0;         // held back by the window
};

/// One open websocket. Every function may be called from any thread and none blocks. After the peer
/// has gone they do nothing.
class Connection {
 public:
  virtual ~Connection() = default;
  Connection() = default;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Queues a message. A peer that does not read its messages is disconnected.
  virtual void send(OutgoingMessage message) = 0;
  /// Queues a frame. Returns the ids of the frames that were dropped to make room (PacketRing).
  virtual std::vector<std::uint64_t> send(OutgoingFrame frame) = 0;
  /// Closes when all queued packets are sent, after two seconds at the latest.
  virtual void close(CloseCode code, std::string_view reason) = 0;

  [[nodiscard]] virtual std::string peer_address() const = 0;
  [[nodiscard]] virtual std::size_t queued_frames() const = 0;
};

/// Receives a Connection's events. Called on the network thread; must not block.
class ConnectionListener {
 public:
  virtual ~ConnectionListener() = default;
  /// One complete binary message within the size limit, and the current state of the link.
  virtual void on_message(std::span<const std::byte> bytes, const LinkState& link) = 0;
  /// A message that is not binary or too large. The connection closes.
  virtual void on_bad_message(std::string_view why) = 0;
  /// The peer sends more than any client needs to. The listener must close the connection; if the
  /// flood continues, the connection closes by itself.
  virtual void on_flood() = 0;
  /// The frame was handed to the socket.
  virtual void on_frame_sent(const FrameTicket& ticket, std::size_t packet_bytes,
                             TimePoint now) = 0;
  /// The last call. `by_leaving`: the peer said that it leaves for good (its page was closed).
  virtual void on_close(bool by_leaving) = 0;
};

/// Makes the listener of a new connection. Called on the network thread.
using ConnectionAcceptor =
    std::function<std::shared_ptr<ConnectionListener>(std::shared_ptr<Connection>)>;

}  // namespace catgs
