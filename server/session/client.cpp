#include "server/session/client.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include <boost/asio/post.hpp>
#include <boost/asio/prefer.hpp>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "server/log.h"
#include "server/net/wire.h"
#include "server/session/log_session.h"
#include "server/session/session_registry.h"

namespace catgs {
namespace {

/// The host's secrets stay the host's, and so does the choice of the scene.
Welcome for_spectators(Welcome welcome) {
  welcome.resume_token.clear();
  welcome.watch_token.clear();
  welcome.scene_ids = {welcome.scene.scene_id};
  welcome.watching = true;
  return welcome;
}

}  // namespace

Client::Client(SessionRegistry& registry, std::string session_id, std::string peer_address)
    : registry_(registry),
      peer_address_(std::move(peer_address)),
      executor_(registry.executor_),
      session_(std::move(session_id), registry.options_.policy, *this, Clock::now()),
      spectators_(registry.options_.max_spectators) {}

Client::~Client() { executor_->close(std::move(stream_)); }

void Client::attach(const std::shared_ptr<Peer>& peer) {
  if (peer_) peer_->dismiss(CloseCode::going_away, "the session goes on in another connection");
  peer_ = peer;
  peer_address_ = peer->connection().peer_address();
  peer->belong_to(shared_from_this());
}

void Client::on_message(Peer& from, const ClientMessage& message, TimePoint now) {
  if (!is_host(from)) return on_spectator_message(from, message);
  if (const auto* hello = std::get_if<Hello>(&message);
      hello && session_.state() == Session::State::awaiting_hello)
    return registry_.on_hello(from.shared_from_this(), shared_from_this(), *hello, now);
  const int in_flight = session_.flow().credit().in_flight();
  session_.on_message(message, now);
  // An acknowledgement of what was never sent, or a second one, is no measurement.
  if (const auto* ack = std::get_if<Ack>(&message);
      ack && session_.flow().credit().in_flight() < in_flight) {
    if (ack->presented_us > 0) {
      registry_.metrics_.motion_to_photon_seconds.Observe(1e-6 * ack->pose_age_us);
      usage_.frame_shown(1e-6 * ack->pose_age_us);
    }
    if (ack->dropped) registry_.metrics_.frames_dropped_by_client.Increment();
  }
  note_readiness(Clock::now());
}

void Client::on_link(Peer& of, const LinkState& link, TimePoint now) {
  if (is_host(of)) session_.on_link(link, now);
}

void Client::add_spectator(const std::shared_ptr<Peer>& peer) {
  Welcome welcome = session_.welcome();
  peer->watch(shared_from_this());
  spectators_.add(peer, for_spectators(std::move(welcome)));
  const LogSession about(session_.id());
  spdlog::info("{} watches", peer->connection().peer_address());
  if (spectators_.wants_idr(Clock::now())) session_.want_idr();
}

void Client::on_spectator_message(Peer& from, const ClientMessage& message) {
  if (std::holds_alternative<RequestIdr>(message)) spectators_.needs_idr(from);
  if (!std::holds_alternative<Bye>(message)) return;
  spectators_.remove(from);
  from.dismiss(CloseCode::normal, "bye");
}

void Client::on_tick(TimePoint now) {
  session_.on_tick(now);
  spectators_.keep_talking(now);
  if (spectators_.wants_idr(now)) session_.want_idr();
}

void Client::note_readiness(TimePoint now) {
  const auto candidate = session_.next_frame();
  if (!candidate) return ready_since_.reset();
  const TimePoint ready = std::max(now, candidate->ready);
  ready_since_ = std::min(ready_since_.value_or(ready), ready);
}

void Client::on_frame_sent(Peer& by, const FrameTicket& ticket, std::size_t packet_bytes,
                           TimePoint now) {
  if (!is_host(by)) return;
  usage_.frame_sent(ticket, now);
  session_.on_frame_sent(ticket, packet_bytes);
}

void Client::on_close(Peer& closed, bool by_leaving) {
  if (!is_host(closed)) return spectators_.remove(closed);
  peer_.reset();
  if (by_leaving || !admitted_at_)
    session_.on_disconnected();
  else
    session_.on_lost(Clock::now());
  if (session_.state() == Session::State::closed) registry_.remove(*this);
}

void Client::refuse(Peer& from, ErrorCode code, std::string_view why) {
  if (is_host(from)) return session_.fail(code, why);
  spectators_.remove(from);
  const ErrorMessage error{code, std::string(why), true};
  note_error(from.connection().peer_address(), error);
  from.connection().send(wire::serialize(error));
  from.dismiss(CloseCode::policy_violation, why);
}

void Client::note_error(const std::string& address, const ErrorMessage& error) {
  const LogSession about(session_.id());
  const std::string line = fmt::format("{}: {}", address, error.message);
  if (error.code == ErrorCode::internal || error.code == ErrorCode::render_failed)
    spdlog::warn(line);
  else
    log_refusal(line);
  if (error.code == ErrorCode::bad_message) registry_.metrics_.bad_messages.Increment();
  if (error.fatal) registry_.metrics_.sessions_refused.Increment();
}

AdmissionAnswer Client::admit(const Hello& hello) {
  token_ = hello.token;
  decoders_ = hello.decoders;
  auto answer = registry_.admit(*this, hello);
  if (const auto* admission = std::get_if<Admission>(&answer)) {
    admitted_at_ = Clock::now();
    const LogSession about(session_.id());
    spdlog::info("{} looks at {}, {}x{}, {}", peer_address_, admission->scene->facts.scene_id,
                 hello.viewport_px.x, hello.viewport_px.y, encoder_name(admission->encoder.kind));
  }
  return answer;
}

void Client::resume(const std::shared_ptr<Peer>& peer, const Hello& hello, Admission admission,
                    TimePoint now) {
  token_ = hello.token;
  decoders_ = hello.decoders;
  attach(peer);
  const LogSession about(session_.id());
  spdlog::info("{} is back", peer_address_);
  session_.on_resumed(hello, std::move(admission), now);
  if (!may_be_watched()) spectators_.dismiss_all();
}

SceneAnswer Client::find_scene(const std::string& scene_id) {
  if (const auto refusal = registry_.authorize_(token_)(scene_id, Use::own_session))
    return ErrorMessage{ErrorCode::unauthorized, *refusal, false};
  return registry_.find_scene(scene_id, Clock::now());
}

std::vector<std::string> Client::scene_ids() {
  std::vector<std::string> ids = registry_.scenes_.scene_ids();
  const Permit permit = registry_.authorize_(token_);
  std::erase_if(ids, [&](const std::string& id) { return permit(id, Use::own_session); });
  return ids;
}

std::uint32_t Client::session_count() { return registry_.admitted_; }

void Client::sign(Welcome& welcome) {
  const SessionTokens& tokens = registry_.tokens_;
  welcome.resume_token =
      tokens.resume_token(session_.id(), welcome.scene.scene_id, registry_.options_.wall_clock_s());
  if (may_be_watched()) welcome.watch_token = tokens.watch_token(session_.id());
}

bool Client::may_be_watched() const {
  return registry_.options_.max_spectators > 0 &&
         !registry_.authorize_(token_)(session_.scene()->facts.scene_id, Use::watch);
}

void Client::send(const ServerMessage& message) {
  if (const auto* error = std::get_if<ErrorMessage>(&message)) note_error(peer_address_, *error);
  if (peer_) peer_->connection().send(wire::serialize(message));
  const TimePoint now = Clock::now();
  if (const auto* welcome = std::get_if<Welcome>(&message))
    spectators_.send(for_spectators(*welcome), now);
  else if (std::holds_alternative<StreamConfig>(message) || std::holds_alternative<Drain>(message))
    spectators_.send(message, now);
}

std::vector<std::uint64_t> Client::send(OutgoingFrame frame) {
  spectators_.send(frame, Clock::now());
  if (!peer_) return {};
  auto dropped = peer_->connection().send(std::move(frame));
  registry_.metrics_.frames_dropped_by_server.Increment(static_cast<double>(dropped.size()));
  return dropped;
}

void Client::close(CloseCode code, std::string_view reason) {
  if (peer_) peer_->connection().close(code, reason);
}

std::size_t Client::queued_frames() const {
  return peer_ ? peer_->connection().queued_frames() : 0;
}

template <typename Result, typename Handle>
std::function<void(Result)> Client::on_session_thread(Handle handle) {
  // Tracked work: the session thread does not end while an executor still owes an answer. The
  // client is moved on to it, so that its last reference never dies on a thread of the executor.
  auto executor = boost::asio::prefer(registry_.io_.get_executor(),
                                      boost::asio::execution::outstanding_work.tracked);
  return [self = shared_from_this(), executor, handle](Result result) mutable {
    boost::asio::post(executor,
                      [self = std::move(self), handle, result = std::move(result)]() mutable {
                        handle(*self, std::move(result));
                        self->registry_.give_frames();
                      });
  };
}

double Client::device_seconds(const FrameStats& stats) const {
  if (!session_.device()) return 0.0;
  return 1e-3 * std::accumulate(stats.stage_ms.begin(), stats.stage_ms.end(), 0.0);
}

void Client::open_stream(StreamSettings settings) {
  settings.seat = encoder_.seat;
  executor_->open(stream_, std::move(settings),
                  on_session_thread<StreamOpened>([](Client& client, const StreamOpened& opened) {
                    if (!opened.ok) client.registry_.metrics_.streams_failed.Increment();
                    if (opened.fault == Fault::device_failed)
                      client.registry_.on_view_refused(opened.message);
                    client.session_.on_stream_opened(opened, Clock::now());
                  }));
}

std::optional<EncoderChoice> Client::other_encoder(Fault why) {
  const EncoderChoice had = encoder_.encoder;
  const bool failed = why == Fault::encoder_failed;
  const TimePoint now = Clock::now();
  auto other = failed ? registry_.encoders_.replace_failed(encoder_, decoders_, now)
                      : registry_.encoders_.replace_refused(encoder_, decoders_, now);
  if (!failed && had.kind == EncoderKind::nvenc) registry_.metrics_.encoders_refused.Increment();
  if (!other) return std::nullopt;  // the session says why it ends
  const LogSession about(session_.id());
  spdlog::warn("{} {}: {}", had.text, failed ? "failed" : "cannot be opened", other->encoder.text);
  encoder_ = *std::move(other);
  return encoder_.encoder;
}

void Client::note_fault(const FrameResult& result) {
  if (!result.ok) {
    const LogSession about(session_.id());
    spdlog::warn("a frame failed: {}", result.message);
  }
  const bool failed = result.fault == Fault::device_failed;
  const bool rendered = result.ok && !result.frame.ticket.refined;
  if (failed || rendered) registry_.on_device(failed);
}

void Client::start_frame(const FrameCandidate& candidate, TimePoint now) {
  FrameOrder order = session_.start_frame(now);
  order.ticket.ready = std::min(std::exchange(ready_since_, std::nullopt).value_or(now), now);
  order.ticket.started = now;
  usage_.frame_started(now);
  FrameJob job{
      stream_,        order.ticket,   order.request, std::move(order.encoding), order.bitrate_kbps,
      order.real_fps, order.force_idr};
  registry_.scheduler_.frame_started(candidate);
  executor_->submit(
      std::move(job),
      on_session_thread<FrameResult>([candidate](Client& client, FrameResult result) {
        client.registry_.scheduler_.frame_ended(candidate);
        client.note_fault(result);
        Metrics& metrics = client.registry_.metrics_;
        (result.ok
             ? (result.frame.ticket.refined ? metrics.frames_refined : metrics.frames_rendered)
             : metrics.frames_failed)
            .Increment();
        metrics.list_entries_overflowed.Increment(
            static_cast<double>(result.stats.overflowed_entries));
        const TimePoint ended = Clock::now();
        const glm::dvec2 size_px = result.frame.ticket.size_px;
        const glm::dvec2 moving_px = client.session_.moving_size_px();
        client.usage_.frame_ended(result.frame.ticket, client.device_seconds(result.stats), ended,
                                  size_px.x * size_px.y / (moving_px.x * moving_px.y));
        client.session_.on_frame(std::move(result), ended);
        client.note_readiness(ended);
      }));
}

}  // namespace catgs
