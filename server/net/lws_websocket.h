#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <libwebsockets.h>

#include "server/base/rate_limit.h"
#include "server/net/connection.h"
#include "server/net/waker.h"
#include "server/pipeline/packet_ring.h"

namespace catgs {

/// Sets up a TCP socket for a stream of frames. Small writes leave at once. The next packet leaves
/// the ring only when hardly anything is unsent, so that waiting packets are counted and can be
/// dropped. BBR keeps its rate where packets are lost at random. A kernel that does not offer it
/// keeps its own congestion control.
void tune_for_frames(int socket);

/// One libwebsockets websocket. Functions that begin with `service_` run on the network thread.
/// Only they touch `wsi_`.
class LwsWebsocket final : public Connection,
                           public Wakeable,
                           public std::enable_shared_from_this<LwsWebsocket> {
 public:
  LwsWebsocket(lws* wsi, std::shared_ptr<LwsWaker> waker, std::string peer_address);

  void send(OutgoingMessage message) override;
  std::vector<std::uint64_t> send(OutgoingFrame frame) override;
  void close(CloseCode code, std::string_view reason) override;
  [[nodiscard]] std::string peer_address() const override { return peer_address_; }
  [[nodiscard]] std::size_t queued_frames() const override;

  void service_listen(std::shared_ptr<ConnectionListener> listener);
  void service_woken() override;
  /// As in all callbacks, nonzero tells libwebsockets to close the socket.
  int service_receive(std::span<const std::byte> fragment);
  int service_writeable(std::vector<std::byte>& scratch);
  /// Checks how much was received.
  int service_timer();
  /// Handles the peer's close frame: two bytes of code, then a reason.
  void service_peer_closes(std::span<const std::byte> payload);
  void service_closed();

 private:
  /// Received data as the kernel counts it, including what libwebsockets handles itself.
  struct Received {
    std::uint32_t segments = 0;
    std::uint64_t bytes = 0;
  };
  struct Closing {
    CloseCode code;
    std::string reason;
  };
  int refuse_message(CloseCode code, std::string_view why);
  int close_now(CloseCode code, std::string_view reason);

  const std::shared_ptr<LwsWaker> waker_;
  const std::string peer_address_;
  lws* wsi_;
  Received arrived_;
  RateLimit arrivals_;
  bool floods_ = false;
  std::shared_ptr<ConnectionListener> listener_;
  std::vector<std::byte> received_;
  bool peer_leaves_ = false;

  mutable std::mutex mutex_;  // guards what follows
  PacketRing ring_;
  std::optional<Closing> closing_;
  bool closed_ = false;
};

}  // namespace catgs
