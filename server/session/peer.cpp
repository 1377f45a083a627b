#include "server/session/peer.h"

#include <utility>

#include <boost/asio/post.hpp>

#include "server/net/wire.h"
#include "server/session/client.h"
#include "server/session/session_registry.h"

namespace catgs {
namespace {

// Poses and acks at 240 Hz each, and room for bursts after a stall.
constexpr double messages_per_second = 600.0;
constexpr double message_burst = 1200.0;
// That the session thread has not come to: four seconds of acks at 240 Hz.
constexpr int max_waiting_messages = 1024;
constexpr std::size_t max_waiting_bytes = 1 << 20;

}  // namespace

Peer::Peer(SessionRegistry& registry, std::shared_ptr<Connection> connection)
    : registry_(registry),
      connection_(std::move(connection)),
      rate_(messages_per_second, message_burst, Clock::now()) {}

template <typename Handle>
void Peer::post(Handle handle, std::size_t bytes) {
  ++waiting_messages_;
  waiting_bytes_ += bytes;
  boost::asio::post(registry_.io_,
                    [self = shared_from_this(), handle = std::move(handle), bytes]() mutable {
                      --self->waiting_messages_;
                      self->waiting_bytes_ -= bytes;
                      if (const auto client = self->client_.lock()) handle(*self, *client);
                      self->registry_.give_frames();
                    });
}

void Peer::on_message(std::span<const std::byte> bytes, const LinkState& link) {
  if (refused_) return;
  const TimePoint now = Clock::now();
  if (!rate_.take(now)) return refuse(ErrorCode::rate_limited, "too many messages");
  auto parsed = wire::parse_client_message(bytes);
  if (const auto* error = std::get_if<wire::ParseError>(&parsed))
    return on_bad_message(error->what);
  auto& message = std::get<ClientMessage>(parsed);
  if (const auto* sample = std::get_if<PoseSample>(&message)) {
    registry_.metrics_.poses_received.Increment();
    if (!latest_pose_.store({*sample, now, link}))
      return registry_.metrics_.poses_superseded.Increment();
    return post([](Peer& self, Client& c) {
      const auto pose = self.latest_pose_.take();
      if (!pose) return;
      c.on_link(self, pose->link, pose->received);
      c.on_message(self, pose->sample, pose->received);
    });
  }
  if (waiting_messages_ >= max_waiting_messages ||
      waiting_bytes_ + bytes.size() > max_waiting_bytes)
    return refuse(ErrorCode::rate_limited, "too many messages wait");
  post(
      [message = std::move(message), now, link](Peer& self, Client& c) {
        c.on_link(self, link, now);
        c.on_message(self, message, now);
      },
      bytes.size());
}

void Peer::refuse(ErrorCode code, std::string why) {
  refused_ = true;
  post([code, why = std::move(why)](Peer& self, Client& c) { c.refuse(self, code, why); });
}

void Peer::on_bad_message(std::string_view why) {
  if (refused_) return;
  refuse(ErrorCode::bad_message, std::string(why));
}

void Peer::on_flood() {
  if (!refused_) refuse(ErrorCode::rate_limited, "too many messages");
}

void Peer::on_frame_sent(const FrameTicket& ticket, std::size_t packet_bytes, TimePoint now) {
  Metrics& metrics = registry_.metrics_;
  metrics.frames_sent.Increment();
  metrics.bytes_sent.Increment(static_cast<double>(packet_bytes));
  if (watching_) return;
  metrics.observe_frame(ticket, now);
  // Not post(): nothing becomes due by it.
  boost::asio::post(registry_.io_, [self = shared_from_this(), ticket, packet_bytes, now] {
    if (const auto client = self->client_.lock())
      client->on_frame_sent(*self, ticket, packet_bytes, now);
  });
}

void Peer::on_close(bool by_leaving) {
  post([by_leaving](Peer& self, Client& c) { c.on_close(self, by_leaving); });
  boost::asio::post(registry_.io_, [self = shared_from_this()] {
    self->registry_.forget_connection(self->connection_->peer_address());
  });
}

void Peer::dismiss(CloseCode code, std::string_view reason) {
  client_.reset();
  connection_->close(code, reason);
}

}  // namespace catgs
