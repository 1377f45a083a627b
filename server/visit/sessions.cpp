#include "server/visit/sessions.h"

#include <algorithm>
#include <utility>

#include <boost/asio/post.hpp>
#include <fmt/format.h>

#include "server/access/signed_token.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"
#include "server/net/trusted_proxies.h"
#include "server/net/wire.h"

namespace catgs {
namespace {

constexpr std::chrono::milliseconds tick_interval{250};

}  // namespace

Sessions::Sessions(VisitContext around) : around_(std::move(around)), tick_timer_(around_.io) {
  tick();
}

std::shared_ptr<ConnectionListener> Sessions::accept(std::shared_ptr<Connection> connection) {
  const std::string address = connection->peer_address();
  auto session = std::make_shared<Session>(around_, *this, random_id(), address);
  auto client =
      std::make_shared<ClientConnection>(around_.io, around_.metrics, std::move(connection),
                                         [this, address] { forget_connection(address); });
  boost::asio::post(around_.io, [this, client, session] { add(client, session); });
  return client;
}

void Sessions::add(const std::shared_ptr<ClientConnection>& connection,
                   const std::shared_ptr<Session>& session) {
  const VisitOptions& options = around_.options;
  const std::string address = limited_as(session->audience().address());
  const int same_address = ++connections_by_address_[address];
  ++connections_;
  sessions_.push_back(session);
  connection->belong_to(*session);
  const auto refuse = [&](std::string_view why) {
    session->visit().fail(ErrorCode::server_full, why);
  };
  if (admission_.is_shut())
    session->visit().end("this server is shutting down", CloseCode::service_restart);
  else if (connections_ > options.max_sessions * (1 + options.max_spectators) + options.max_queue +
                              options.max_greeting)
    refuse("too many connections: try again in a minute");
  else if (same_address > options.max_sessions_per_address)
    refuse(
        fmt::format("{} connections from {} already: close one first", same_address - 1, address));
}

void Sessions::forget_connection(const std::string& address) {
  --connections_;
  const auto it = connections_by_address_.find(limited_as(address));
  if (--it->second == 0) connections_by_address_.erase(it);
}

void Sessions::on_hello(const std::shared_ptr<ClientConnection>& from,
                        std::shared_ptr<Session> newcomer, Hello hello, TimePoint now) {
  const auto host = hello.watch_token.empty() ? host_for_spectator(hello)
                                              : tour_host(hello.watch_token, hello.token);
  if (host) {
    if (const auto* error = std::get_if<ErrorMessage>(&*host))
      return newcomer->visit().fail(error->code, error->message);
    if (!has_room_for_follower(hello, *std::get<Session*>(*host)))
      return watch(from, *newcomer, *std::get<Session*>(*host), hello, now);
  }
  const auto resumed =
      around_.tokens.read_resume_token(hello.resume_token, around_.options.wall_clock_s());
  if (resumed && hello.version >= wire::version) {
    // The name may by now mean a scene other than the one that was shown.
    if (hello.scene_id.empty() || hello.scene_id == name_in(resumed->scene_id))
      hello.scene_id = resumed->scene_id;
    if (const auto known = find_session(sessions_, resumed->session_id)) {
      if (resume(from, *newcomer, *known, hello, now)) return;
    } else {
      // The session comes from another server of the fleet, or its grace is over. It keeps its id.
      newcomer->audience().detach();
      const auto session = std::ranges::find(sessions_, newcomer);
      newcomer = std::make_shared<Session>(around_, *this, resumed->session_id,
                                           newcomer->audience().address());
      *session = newcomer;
      from->belong_to(*newcomer);
    }
  }
  newcomer->visit().on_message(hello, now);
  admission_.on_newcomer(now);
}

bool Sessions::resume(const std::shared_ptr<ClientConnection>& connection, Session& newcomer,
                      Session& known, const Hello& hello, TimePoint now) {
  const auto choice = admission_.choose(hello);
  const auto* scene_id = std::get_if<std::string>(&choice);
  if (!scene_id || !known.visit().life().resumable()) return false;
  // The session's own scene is in memory. A client that selects another scene begins a new session
  // and may have to wait.
  auto found = find_scene(around_.scenes, *scene_id, now);
  auto* scene = std::get_if<std::shared_ptr<const SceneEntry>>(&found);
  if (!scene) return false;
  around_.metrics.sessions_resumed.Increment();
  newcomer.audience().detach();
  leave(newcomer);
  Visitor& visitor = known.visitor();
  visitor.come_by(hello.token, around_.authorize);
  const auto best =
      best_encoder(around_.encoders, hello.decoders);  // choose() has checked that there is one
  if (visitor.encoder.codec != best->codec) visitor.encoder = *best;
  connection->belong_to(known);
  {
    const LogScope about(known.facts());
    log_info({.event = "session_resumed", .scene = (*scene)->facts.scene_id}, "{} is back",
             known.audience().address());
  }
  const PicturePlan& plan = known.visit().stream().plan();
  known.visit().on_resumed(
      hello, {std::move(*scene), visitor.encoder, plan.effort(), plan.pixel_share()}, now);
  if (!known.may_be_watched()) known.audience().end_tour();
  around_.frames.changed(known);
  return true;
}

std::variant<Session*, ErrorMessage> Sessions::tour_host(const std::string& watch_token,
                                                         const std::string& access_token) {
  const auto refused = [](ErrorCode code, std::string_view why) {
    return ErrorMessage{code, std::string(why), true};
  };
  const auto id = around_.tokens.read_watch_token(watch_token);
  if (!id)
    return refused(ErrorCode::unauthorized, "this link to watch a session is not valid here");
  const auto host = find_session(sessions_, *id);
  if (!host || !host->visit().life().resumable())
    return refused(ErrorCode::session_ended, "the session of this link has ended");
  if (host->visit().life().state() != VisitState::live)
    return refused(ErrorCode::server_full, "the session of this link is about to start");
  if (!host->may_be_watched())
    return refused(ErrorCode::unauthorized,
                   "the session of this link is not to be watched any more");
  if (!host->audience().tour().since())
    return refused(ErrorCode::session_ended, "the session of this link does not present now");
  // The host's link opens the tour, also to those without an access token. Only a link
  // of role solo is refused: its holder chose not to watch.
  const std::string& scene_id = host->visit().stream().scene()->facts.scene_id;
  const Permit permit = around_.authorize(access_token);
  if (around_.revoked_links()->contains(permit.link_id))
    return refused(ErrorCode::unauthorized, link_revoked);
  if (const auto why = permit.refusal(scene_id, Use::watch);
      why && permit.allows(scene_id, Use::own_session))
    return refused(ErrorCode::unauthorized, *why);
  return host.get();
}

std::optional<std::variant<Session*, ErrorMessage>> Sessions::host_for_spectator(
    const Hello& hello) {
  const Permit permit = around_.authorize(hello.token);
  const auto only_watches = [&](const std::string& scene_id) {
    return !permit.allows(scene_id, Use::own_session) && permit.allows(scene_id, Use::watch);
  };
  const std::string wanted = around_.scenes.resolve(hello.scene_id);
  const auto ids = around_.scenes.scene_ids();
  if (!hello.scene_id.empty() ? !only_watches(wanted) : std::ranges::none_of(ids, only_watches))
    return std::nullopt;
  Session* first = nullptr;
  for (const auto& session : sessions_) {
    const auto since = session->audience().tour().since();
    if (!since || session->visit().life().state() != VisitState::live || !session->may_be_watched())
      continue;
    const std::string& scene_id = session->visit().stream().scene()->facts.scene_id;
    if (!only_watches(scene_id) || (!hello.scene_id.empty() && scene_id != wanted)) continue;
    if (!first || *since < *first->audience().tour().since()) first = session.get();
  }
  if (first) return first;
  return ErrorMessage{ErrorCode::no_leader, "nobody leads through this scene now", true};
}

bool Sessions::has_room_for_follower(Hello& hello, Session& host) {
  const std::string& scene_id = host.visit().stream().scene()->facts.scene_id;
  if (!hello.follow || !around_.authorize(hello.token).allows(scene_id, Use::own_session))
    return false;
  hello.scene_id = scene_id;
  return admission_.has_spare_slot(hello);
}

void Sessions::watch(const std::shared_ptr<ClientConnection>& connection, Session& newcomer,
                     Session& host, const Hello& hello, TimePoint now) {
  const auto refuse = [&](ErrorCode code, std::string_view why) {
    newcomer.visit().fail(code, why);
  };
  Visit& visit = host.visit();
  Audience& audience = host.audience();
  if (std::ranges::count(hello.decoders, visit.stream().config().codec) == 0)
    return refuse(ErrorCode::no_common_codec,
                  "the client cannot decode what the session of this link is encoded as");
  if (audience.full())
    return refuse(ErrorCode::server_full,
                  fmt::format("{} people watch this session already", audience.participants()));
  newcomer.audience().detach();
  leave(newcomer);
  const Permit permit = around_.authorize(hello.token);
  connection->watch(host);
  Welcome welcome = welcome_to(visit.stream(), host);
  welcome.may_leave = permit.allows(welcome.scene.scene_id, Use::own_session);
  welcome.scene_pass = scene_pass(around_, host.visitor(), welcome.scene.scene_id);
  audience.add(connection, std::move(welcome), permit.link_id);
  {
    const std::string address = connection->connection().peer_address();
    LogFacts facts = host.facts();
    facts.event = "spectator_joined";
    facts.address = address;
    facts.link = permit.link_id;
    log_info(facts, "{}{} watches", address, by_link(facts));
  }
  if (audience.wants_idr(now)) visit.stream().idr().request();
  around_.frames.changed(host);
}

void Sessions::follow(Session& session, ClientConnection& from, const Follow& request,
                      TimePoint now) {
  for (const auto& other : sessions_) other->audience().tour().remove(from);
  if (request.watch_token.empty()) return;
  const auto refuse = [&](ErrorCode code, std::string why) {
    session.visit().say(ErrorMessage{code, std::move(why), false}, now);
    session.visit().say(Lead{LeadState::ended, {}, 0, {}}, now);
  };
  const auto found = tour_host(request.watch_token, session.visitor().token);
  if (const auto* error = std::get_if<ErrorMessage>(&found))
    return refuse(error->code, error->message);
  Session& host = *std::get<Session*>(found);
  if (&host == &session) return refuse(ErrorCode::bad_message, "a session cannot follow itself");
  const auto scene_of = [](Session& any) { return any.visit().stream().scene()->facts.scene_id; };
  if (scene_of(host) != scene_of(session))
    return session.visit().say(Lead{.state = LeadState::ended,
                                    .name = host.audience().tour().name(),
                                    .camera = {},
                                    .elsewhere = true},
                               now);
  if (host.audience().full())
    return refuse(ErrorCode::server_full, fmt::format("{} people follow this session already",
                                                      host.audience().participants()));
  host.audience().tour().add(from.shared_from_this());
}

void Sessions::stop_following(Session& session) {
  const ClientConnection* const visitor = session.audience().visitor();
  Session* const host = visitor ? host_of(*visitor) : nullptr;
  if (!host) return;
  host->audience().tour().remove(*visitor);
  session.send(Lead{LeadState::ended, {}, 0, {}});
}

Session* Sessions::host_of(const ClientConnection& follower) {
  const auto found = std::ranges::find_if(
      sessions_, [&](const auto& session) { return session->audience().tour().has(follower); });
  return found == sessions_.end() ? nullptr : found->get();
}

void Sessions::tell_positions(Session& host, TimePoint now) {
  SharedTour& tour = host.audience().tour();
  if (!tour.since()) return;
  Participants participants;
  const auto add = [&](Session& session) {
    if (const auto& camera = session.audience().tour().camera();
        camera && camera->view_height == 0.0f && participants.positions.size() < most_told_places)
      participants.positions.push_back(camera->world_from_camera.position);
  };
  if (tour.tells_positions()) {
    add(host);
    for (const auto& session : sessions_)
      if (const auto* visitor = session->audience().visitor(); visitor && tour.has(*visitor))
        add(*session);
  }
  if (tour.tell(participants, now)) host.audience().tell(participants, now);
}

void Sessions::leave(Session& session) {
  const auto it = std::ranges::find(sessions_, &session, [](const auto& p) { return p.get(); });
  if (it == sessions_.end()) return;
  const TimePoint now = Clock::now();
  if (session.visitor().admitted_at) {
    const VisitStatistics& seen = session.visit().statistics();
    const LogScope about(session.facts());
    log_info({.event = "session_ended"}, "ended after {} frames, {} bytes, {} dropped",
             seen.frames_sent(), seen.bytes_sent(), seen.frames_dropped());
  }
  admission_.leave(session, now);
  around_.frames.withdraw(session);
  session.audience().end_tour();
  sessions_.erase(it);
  admission_.admit_waiting(now);
}

void Sessions::end_revoked(Session& session, const LinkIds& revoked) {
  for (const auto& spectator : session.audience().spectators_by(revoked))
    session.refuse(*spectator, ErrorCode::unauthorized, link_revoked);
  if (!revoked.contains(session.visitor().link_id)) return;
  session.visit().fail(ErrorCode::unauthorized, link_revoked);
  around_.frames.changed(session);
}

void Sessions::tick() {
  if (stopped_) return;
  around_.options.on_tick();
  const TimePoint now = Clock::now();
  around_.scenes.on_tick(now);
  const RevokedLinks revoked = around_.revoked_links();
  SessionList gone;
  for (const auto& session : sessions_) {
    if (!revoked->empty()) end_revoked(*session, *revoked);
    session->on_tick(now, admission_.admitted());
    tell_positions(*session, now);
    if (!session->audience().visitor() && session->visit().life().state() == VisitState::closed)
      gone.push_back(session);
  }
  for (const auto& session : gone) leave(*session);
  anybody_looks_ = std::ranges::any_of(
      sessions_, [](const auto& session) { return session->visit().life().on_show(); });
  machine_.on_tick(sessions_, admission_.admitted(), now);
  admission_.on_tick(now);
  for (const auto& session : sessions_) around_.frames.changed(*session);
  around_.metrics.connections.Set(connections_);
  reports_.publish(sessions_, around_.encoders, around_.metrics);
  tick_timer_.expires_after(tick_interval);
  tick_timer_.async_wait([this](const boost::system::error_code& error) {
    if (!error) tick();
  });
}

void Sessions::drain(std::chrono::milliseconds deadline) {
  admission_.shut();
  const Drain drain{static_cast<std::uint32_t>(deadline.count())};
  for (const auto& session : sessions_) session->visit().say(drain, Clock::now());
}

void Sessions::close_all() {
  for (const auto& session : sessions_) {
    session->visit().end("the server is shutting down");
    around_.frames.changed(*session);
  }
}

void Sessions::stop_timer() {
  stopped_ = true;  // cancel() does not take back a handler that is queued: that would re-arm
  tick_timer_.cancel();
}

}  // namespace catgs
