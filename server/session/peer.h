#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <string>

#include "server/net/connection.h"
#include "server/net/messages.h"
#include "server/pipeline/latest_slot.h"
#include "server/session/rate_limit.h"

namespace catgs {

class Client;
class SessionRegistry;

/// One websocket as sessions see it. What comes in on the network thread is limited in rate, parsed
/// and posted to the session thread, where it belongs to a Client: that of its own session, the one
/// that a resume token led to, or the one it watches. Poses wait in a slot where the newest wins;
/// other messages are few and posted one by one, up to a bound.
class Peer final : public ConnectionListener, public std::enable_shared_from_this<Peer> {
 public:
  Peer(SessionRegistry& registry, std::shared_ptr<Connection> connection);

  // Network thread.
  void on_message(std::span<const std::byte> bytes, const LinkState& link) override;
  void on_bad_message(std::string_view why) override;
  void on_flood() override;
  void on_frame_sent(const FrameTicket& ticket, std::size_t packet_bytes, TimePoint now) override;
  void on_close(bool by_leaving) override;

  // Session thread, and the constructing one.
  /// From here on messages are for this client.
  void belong_to(const std::shared_ptr<Client>& client) { client_ = client; }
  /// The same, and what is sent counts for nobody's latency.
  void watch(const std::shared_ptr<Client>& client) {
    watching_ = true;
    belong_to(client);
  }
  /// Closes, and nothing that still comes in is for anybody.
  void dismiss(CloseCode code, std::string_view reason);
  [[nodiscard]] Connection& connection() const { return *connection_; }

 private:
  struct ReceivedPose {
    PoseSample sample;
    TimePoint received;
    LinkState link;
  };
  /// Posts `handle(client)`, which holds a message of so many `bytes`, to the session thread, then
  /// lets the registry look for work.
  template <typename Handle>
  void post(Handle handle, std::size_t bytes = 0);
  /// Nothing more is read, and the connection closes.
  void refuse(ErrorCode code, std::string why);

  SessionRegistry& registry_;
  const std::shared_ptr<Connection> connection_;

  RateLimit rate_;        // network thread
  bool refused_ = false;  // network thread: nothing more is read
  // Posted, and not handled yet: the session thread may be busy for long.
  std::atomic<int> waiting_messages_{0};
  std::atomic<std::size_t> waiting_bytes_{0};
  LatestSlot<ReceivedPose> latest_pose_;
  std::weak_ptr<Client> client_;  // session thread
  std::atomic<bool> watching_{false};
};

}  // namespace catgs
