#include "server/net/lws_websocket.h"

#include <algorithm>

#include <linux/tcp.h>  // glibc's tcp_info lacks the newer fields
#include <netinet/in.h>
#include <sys/socket.h>

#include "server/net/wire.h"

namespace catgs {
namespace {

constexpr int close_timeout_s = 2;

// libwebsockets answers pings and drops pongs without telling us, so the kernel's byte count is
// used. A segment may cost a read and a pong. The rate is that of messages (client_connection.cpp).
constexpr double segments_per_second = 600.0;
constexpr double segment_burst = 1200.0;
constexpr double segment_bytes = 1024.0;  // a longer one counts as several
constexpr lws_usec_t look_every_us = 250'000;

/// All websockets look at the same times. libwebsockets 4.1.6 does not block in the last
/// millisecond before a timer. 64 websockets with timers of their own made 6,000 idle rounds a
/// second.
lws_usec_t until_next_look() { return look_every_us - lws_now_usecs() % look_every_us; }

tcp_info info_of(lws* wsi) {
  tcp_info info{};
  socklen_t size = sizeof info;  // an older kernel fills less, and the rest stays 0
  if (::getsockopt(lws_get_socket_fd(wsi), IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return {};
  return info;
}

LinkState link_state(lws* wsi) {
  const tcp_info info = info_of(wsi);
  return {info.tcpi_rtt, 8 * info.tcpi_delivery_rate, info.tcpi_snd_cwnd * info.tcpi_snd_mss,
          info.tcpi_notsent_bytes};
}

}  // namespace

void tune_for_frames(int socket) {
  const int on = 1;
  const int lowat_bytes = 16 * 1024;
  constexpr std::string_view congestion_control = "bbr";
  ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  ::setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &lowat_bytes, sizeof lowat_bytes);
  ::setsockopt(socket, IPPROTO_TCP, TCP_CONGESTION, congestion_control.data(),
               congestion_control.size());
}

LwsWebsocket::LwsWebsocket(lws* wsi, std::shared_ptr<LwsWaker> waker, std::string peer_address)
    : waker_(std::move(waker)),
      peer_address_(std::move(peer_address)),
      wsi_(wsi),
      arrivals_(segments_per_second, segment_burst, Clock::now()) {
  tune_for_frames(lws_get_socket_fd(wsi));
}

void LwsWebsocket::send(OutgoingMessage message) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_ || closing_) return;
    if (!ring_.push(std::move(message)))
      closing_ = {CloseCode::policy_violation, "messages are not read"};
  }
  waker_->wake(shared_from_this());
}

std::vector<std::uint64_t> LwsWebsocket::send(OutgoingFrame frame) {
  std::vector<std::uint64_t> dropped;
  {
    const std::lock_guard lock(mutex_);
    if (closed_ || closing_) return {};
    dropped = ring_.push(std::move(frame));
  }
  waker_->wake(shared_from_this());
  return dropped;
}

void LwsWebsocket::close(CloseCode code, std::string_view reason) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_ || closing_) return;
    closing_ = {code, std::string(reason)};
  }
  waker_->wake(shared_from_this());
}

std::size_t LwsWebsocket::queued_frames() const {
  const std::lock_guard lock(mutex_);
  return ring_.frames();
}

void LwsWebsocket::service_listen(std::shared_ptr<ConnectionListener> listener) {
  listener_ = std::move(listener);
  const tcp_info info = info_of(wsi_);
  arrived_ = {info.tcpi_data_segs_in, info.tcpi_bytes_received};
  lws_set_timer_usecs(wsi_, until_next_look());
}

int LwsWebsocket::service_timer() {
  lws_set_timer_usecs(wsi_, until_next_look());
  const tcp_info info = info_of(wsi_);
  const double segments = info.tcpi_data_segs_in - arrived_.segments;
  const auto bytes = static_cast<double>(info.tcpi_bytes_received - arrived_.bytes);
  arrived_ = {info.tcpi_data_segs_in, info.tcpi_bytes_received};
  if (arrivals_.take(Clock::now(), std::max(segments, bytes / segment_bytes))) return 0;
  if (std::exchange(floods_, true)) return -1;  // already refused, and still flooding
  listener_->on_flood();
  return 0;
}

void LwsWebsocket::service_woken() {
  if (!wsi_) return;
  bool closing = false;
  {
    const std::lock_guard lock(mutex_);
    closing = closing_.has_value();
  }
  if (closing) lws_set_timeout(wsi_, PENDING_TIMEOUT_CLOSE_SEND, close_timeout_s);
  lws_callback_on_writable(wsi_);
}

int LwsWebsocket::service_receive(std::span<const std::byte> fragment) {
  if (!lws_frame_is_binary(wsi_))
    return refuse_message(CloseCode::unsupported_data, "binary messages only");
  if (received_.size() + fragment.size() > wire::max_client_message_bytes)
    return refuse_message(CloseCode::too_big, "message over 64 KiB");
  received_.insert(received_.end(), fragment.begin(), fragment.end());
  if (lws_is_final_fragment(wsi_) && lws_remaining_packet_payload(wsi_) == 0) {
    listener_->on_message(received_, link_state(wsi_));
    received_.clear();
  }
  return 0;
}

int LwsWebsocket::service_writeable(std::vector<std::byte>& scratch) {
  // libwebsockets itself closes a connection that breaks the protocol. Nothing may be sent after
  // that.
  if (lws_get_close_length(wsi_) > 0) return 0;
  std::optional<PacketRing::Packet> packet;
  std::optional<Closing> closing;
  bool more = false;
  {
    const std::lock_guard lock(mutex_);
    packet = ring_.pop();
    more = !ring_.empty() || closing_;
    if (!packet) closing = closing_;
  }
  if (closing) return close_now(closing->code, closing->reason);
  if (!packet) return 0;

  // libwebsockets writes its framing into the bytes before the payload.
  scratch.assign(LWS_PRE, std::byte{0});
  const TimePoint now = Clock::now();
  if (packet->frame) wire::append_frame_header(*packet->frame, packet->depths.get(), now, scratch);
  scratch.insert(scratch.end(), packet->bytes.begin(), packet->bytes.end());
  const std::size_t size = scratch.size() - LWS_PRE;
  auto* payload = reinterpret_cast<unsigned char*>(scratch.data()) + LWS_PRE;
  if (lws_write(wsi_, payload, size, LWS_WRITE_BINARY) < static_cast<int>(size)) return -1;
  if (packet->frame) listener_->on_frame_sent(*packet->frame, size, now);
  if (more) lws_callback_on_writable(wsi_);
  return 0;
}

void LwsWebsocket::service_peer_closes(std::span<const std::byte> payload) {
  // Browsers send this code when a page is closed or left. A client that reconnects sends another
  // code.
  constexpr auto leaves = static_cast<unsigned>(CloseCode::going_away);
  peer_leaves_ = payload.size() >= 2 && (std::to_integer<unsigned>(payload[0]) << 8 |
                                         std::to_integer<unsigned>(payload[1])) == leaves;
}

void LwsWebsocket::service_closed() {
  wsi_ = nullptr;
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    ring_ = PacketRing();
  }
  if (listener_) listener_->on_close(peer_leaves_);
  listener_.reset();
}

int LwsWebsocket::refuse_message(CloseCode code, std::string_view why) {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;  // nothing goes out behind the close frame
  }
  listener_->on_bad_message(why);
  return close_now(code, why);
}

int LwsWebsocket::close_now(CloseCode code, std::string_view reason) {
  std::string text(reason.substr(0, 120));  // a close frame has room for 123 bytes
  lws_close_reason(wsi_, static_cast<lws_close_status>(code),
                   reinterpret_cast<unsigned char*>(text.data()), text.size());
  return -1;
}

}  // namespace catgs
