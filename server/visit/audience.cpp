#include "server/visit/audience.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/net/wire.h"
#include "server/visit/visit_policy.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

// An IDR is many times the size of other frames, and the visitor pays for it too.
constexpr auto min_idr_interval = 1s;

/// The visitor's secrets stay the visitor's, and so does the choice of the scene.
Welcome for_spectators(Welcome welcome) {
  welcome.resume_token.clear();
  welcome.watch_token.clear();
  welcome.scene_ids = {welcome.scene.scene_id};
  welcome.watching = true;
  return welcome;
}

}  // namespace

void Audience::attach(std::shared_ptr<ClientConnection> connection) {
  if (visitor_)
    visitor_->dismiss(CloseCode::going_away, "the session continues in another connection");
  address_ = connection->connection().peer_address();
  visitor_ = std::move(connection);
}

void Audience::close(CloseCode code, std::string_view reason) {
  if (visitor_) visitor_->connection().close(code, reason);
}

void Audience::send(const ServerMessage& message, TimePoint now) {
  if (visitor_) visitor_->connection().send(wire::serialize(message));
  if (const auto* welcome = std::get_if<Welcome>(&message)) {
    // Its participants send a new hello, if they want to see what the visitor shows there. Each
    // gets a visit of its own where its own link allows that, and watches otherwise.
    if (!is_in(welcome->scene.scene_id)) {
      end_tour(true);
      tour_.forget_camera();
      scene_id_ = welcome->scene.scene_id;
    }
    tell_spectators(for_spectators(*welcome), now);
  } else if (std::holds_alternative<StreamConfig>(message) ||
             std::holds_alternative<Drain>(message))
    tell_spectators(message, now);
}

std::vector<std::uint64_t> Audience::send(OutgoingFrame frame, TimePoint now) {
  const bool idr = frame.ticket.idr;
  if (idr) last_idr_ = now;
  if (!spectators_.empty()) last_said_ = now;
  for (Spectator& s : spectators_) {
    if (s.waits_for_idr && !idr) continue;
    s.waits_for_idr = !s.connection->connection().send(frame).empty();
  }
  if (!visitor_) return {};
  return visitor_->connection().send(std::move(frame));
}

void Audience::add(std::shared_ptr<ClientConnection> spectator, Welcome welcome,
                   std::string link_id) {
  spectator->connection().send(wire::serialize(for_spectators(std::move(welcome))));
  if (const Participants& participants = tour_.positions_told(); !participants.positions.empty())
    spectator->connection().send(wire::serialize(participants));
  spectators_.push_back({std::move(spectator), true, std::move(link_id)});
}

std::string Audience::link_of(const ClientConnection& spectator) const {
  for (const Spectator& s : spectators_)
    if (s.connection.get() == &spectator) return s.link_id;
  return {};
}

std::vector<std::shared_ptr<ClientConnection>> Audience::spectators_by(
    const LinkIds& link_ids) const {
  std::vector<std::shared_ptr<ClientConnection>> found;
  for (const Spectator& s : spectators_)
    if (link_ids.contains(s.link_id)) found.push_back(s.connection);
  return found;
}

void Audience::remove(const ClientConnection& spectator) {
  std::erase_if(spectators_, [&](const Spectator& s) { return s.connection.get() == &spectator; });
}

void Audience::on_message(ClientConnection& spectator, const ClientMessage& message) {
  if (std::holds_alternative<RequestIdr>(message))
    for (Spectator& s : spectators_)
      if (s.connection.get() == &spectator) s.waits_for_idr = true;
  if (!std::holds_alternative<Bye>(message)) return;
  remove(spectator);
  spectator.dismiss(CloseCode::normal, "bye");
}

void Audience::tell_spectators(const ServerMessage& message, TimePoint now) {
  if (spectators_.empty()) return;
  last_said_ = now;
  const OutgoingMessage outgoing = wire::serialize(message);
  for (Spectator& s : spectators_) s.connection->connection().send(outgoing);
}

bool Audience::wants_idr(TimePoint now) const {
  return (!last_idr_ || now - *last_idr_ >= min_idr_interval) &&
         std::ranges::any_of(spectators_, &Spectator::waits_for_idr);
}

void Audience::keep_talking(
    TimePoint now, const std::function<std::string(const std::string& scene_id)>& scene_pass) {
  const auto pass = [&] { return scene_pass(scene_id_); };
  if (const auto lead = tour_.news(spectators_.size(), !visitor_, now, pass)) tell(*lead, now);
  if (last_said_ && now - *last_said_ < speak_at_least_every) return;
  tell_spectators(heartbeat_at(now), now);
}

void Audience::tell(const ServerMessage& message, TimePoint now) {
  if (visitor_) visitor_->connection().send(wire::serialize(message));
  tell_spectators(message, now);
}

void Audience::end_tour(bool elsewhere) {
  tour_.end(elsewhere);
  for (const Spectator& s : std::exchange(spectators_, {})) {
    s.connection->connection().send(wire::serialize(
        ErrorMessage{ErrorCode::session_ended, "the presentation has ended", true}));
    s.connection->dismiss(CloseCode::normal, "the presentation has ended");
  }
}

}  // namespace catgs
