#include "server/visit/client_connection.h"

#include <utility>

#include <boost/asio/post.hpp>

#include "server/net/wire.h"
#include "server/pipeline/frame_metrics.h"
#include "server/visit/session.h"

namespace catgs {
namespace {

// Enough for poses and acks at 240 Hz each, and for bursts after a stall.
constexpr double messages_per_second = 600.0;
constexpr double message_burst = 1200.0;
// Bounds what the session thread has not handled yet: four seconds of acks at 240 Hz.
constexpr int max_waiting_messages = 1024;
constexpr std::size_t max_waiting_bytes = 1 << 20;

}  // namespace

ClientConnection::ClientConnection(boost::asio::io_context& io, Metrics& metrics,
                                   std::shared_ptr<Connection> connection,
                                   std::function<void()> on_closed)
    : io_(io),
      metrics_(metrics),
      connection_(std::move(connection)),
      on_closed_(std::move(on_closed)),
      rate_(messages_per_second, message_burst, Clock::now()) {}

template <typename Handle>
void ClientConnection::post(Handle handle, std::size_t bytes) {
  ++waiting_messages_;
  waiting_bytes_ += bytes;
  boost::asio::post(io_, [self = shared_from_this(), handle = std::move(handle), bytes]() mutable {
    --self->waiting_messages_;
    self->waiting_bytes_ -= bytes;
    if (const auto session = self->session_.lock()) handle(*self, *session);
  });
}

void ClientConnection::on_message(std::span<const std::byte> bytes, const LinkState& link) {
  if (refused_) return;
  const TimePoint now = Clock::now();
  if (!rate_.take(now)) return refuse(ErrorCode::rate_limited, "too many messages");
  auto parsed = wire::parse_client_message(bytes);
  if (const auto* error = std::get_if<wire::ParseError>(&parsed))
    return on_bad_message(error->what);
  auto& message = std::get<ClientMessage>(parsed);
  if (const auto* sample = std::get_if<PoseSample>(&message)) {
    metrics_.poses_received.Increment();
    if (!latest_pose_.store({*sample, now, link})) return metrics_.poses_superseded.Increment();
    return post([](ClientConnection& self, Session& session) {
      if (const auto pose = self.latest_pose_.take())
        session.on_message(self, pose->sample, pose->link, pose->received);
    });
  }
  if (waiting_messages_ >= max_waiting_messages ||
      waiting_bytes_ + bytes.size() > max_waiting_bytes)
    return refuse(ErrorCode::rate_limited, "too many messages wait");
  post(
      [message = std::move(message), now, link](ClientConnection& self, Session& session) {
        session.on_message(self, message, link, now);
      },
      bytes.size());
}

void ClientConnection::refuse(ErrorCode code, std::string why) {
  if (std::exchange(refused_, true)) return;
  post([code, why = std::move(why)](ClientConnection& self, Session& session) {
    session.refuse(self, code, why);
  });
}

void ClientConnection::on_bad_message(std::string_view why) {
  refuse(ErrorCode::bad_message, std::string(why));
}

void ClientConnection::on_flood() { refuse(ErrorCode::rate_limited, "too many messages"); }

void ClientConnection::on_frame_sent(const FrameTicket& ticket, std::size_t packet_bytes,
                                     TimePoint now) {
  metrics_.frames_sent.Increment();
  metrics_.bytes_sent.Increment(static_cast<double>(packet_bytes));
  if (watching_) return;
  observe_frame(metrics_, ticket, now);
  // Not post(): this is not a client's message.
  boost::asio::post(io_, [self = shared_from_this(), ticket, packet_bytes, now] {
    if (const auto session = self->session_.lock())
      session->on_frame_sent(*self, ticket, packet_bytes, now);
  });
}

void ClientConnection::on_close(bool by_leaving) {
  boost::asio::post(io_, [self = shared_from_this(), by_leaving] {
    if (const auto session = self->session_.lock()) session->on_close(*self, by_leaving);
    self->on_closed_();
  });
}

void ClientConnection::belong_to(Session& session) {
  session_ = session.weak_from_this();
  session.audience().attach(shared_from_this());
}

void ClientConnection::watch(Session& session) {
  watching_ = true;
  session_ = session.weak_from_this();
}

void ClientConnection::dismiss(CloseCode code, std::string_view reason) {
  session_.reset();
  connection_->close(code, reason);
}

}  // namespace catgs
