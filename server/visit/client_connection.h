#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include <boost/asio/io_context.hpp>

#include "server/base/metrics.h"
#include "server/base/rate_limit.h"
#include "server/net/connection.h"
#include "server/net/messages.h"
#include "server/pipeline/latest_slot.h"

namespace catgs {

class Session;

/// The visits' end of one websocket. Messages from the network thread are rate-limited, parsed and
/// posted to the session thread. The connection belongs to one Session: its own new one, the one of
/// its resume token, or the one that it watches. Poses go through a slot that keeps only the
/// newest. Other messages are posted one by one, up to a bound.
class ClientConnection final : public ConnectionListener,
                               public std::enable_shared_from_this<ClientConnection> {
 public:
  /// `on_closed` is called last, on the session thread, which runs `io`.
  ClientConnection(boost::asio::io_context& io, Metrics& metrics,
                   std::shared_ptr<Connection> connection, std::function<void()> on_closed);

  // Network thread.
  void on_message(std::span<const std::byte> bytes, const LinkState& link) override;
  void on_bad_message(std::string_view why) override;
  void on_flood() override;
  void on_frame_sent(const FrameTicket& ticket, std::size_t packet_bytes, TimePoint now) override;
  void on_close(bool by_leaving) override;

  // Session thread.
  /// Makes this the connection of the visitor of `session`. The session's previous connection is
  /// closed.
  void belong_to(Session& session);
  /// Makes this a spectator's connection. Frames sent to it are left out of latency measurements.
  void watch(Session& session);
  /// Closes the connection. Messages that still arrive are dropped.
  void dismiss(CloseCode code, std::string_view reason);
  [[nodiscard]] Connection& connection() const { return *connection_; }

 private:
  struct ReceivedPose {
    PoseSample sample;
    TimePoint received;
    LinkState link;
  };
  /// Posts `handle(session)` to the session thread. `bytes` is the size of the message that it
  /// holds.
  template <typename Handle>
  void post(Handle handle, std::size_t bytes = 0);
  /// Stops reading and closes the connection, once.
  void refuse(ErrorCode code, std::string why);

  boost::asio::io_context& io_;
  Metrics& metrics_;
  const std::shared_ptr<Connection> connection_;
  const std::function<void()> on_closed_;

  RateLimit rate_;        // network thread
  bool refused_ = false;  // network thread: nothing more is read
  // Posted but not handled yet, as the session thread may be busy for a while.
  std::atomic<int> waiting_messages_{0};
  std::atomic<std::size_t> waiting_bytes_{0};
  LatestSlot<ReceivedPose> latest_pose_;
  std::weak_ptr<Session> session_;  // session thread
  std::atomic<bool> watching_{false};
};

}  // namespace catgs
