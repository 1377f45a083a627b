#include "server/visit/places.h"

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

Places::Places(VisitContext around) : around_(std::move(around)), tick_timer_(around_.io) {
  tick();
}

std::shared_ptr<ConnectionListener> Places::accept(std::shared_ptr<Connection> connection) {
  const std::string address = connection->peer_address();
  auto place = std::make_shared<Place>(around_, *this, random_id(), address);
  auto client =
      std::make_shared<ClientConnection>(around_.io, around_.metrics, std::move(connection),
                                         [this, address] { forget_connection(address); });
  boost::asio::post(around_.io, [this, client, place] { add(client, place); });
  return client;
}

void Places::add(const std::shared_ptr<ClientConnection>& connection,
                 const std::shared_ptr<Place>& place) {
  const VisitOptions& options = around_.options;
  const std::string address = limited_as(place->audience().address());
  const int same_address = ++connections_by_address_[address];
  ++connections_;
  places_.push_back(place);
  connection->belong_to(*place);
  const auto refuse = [&](std::string_view why) {
    place->visit().fail(ErrorCode::server_full, why);
  };
  if (desk_.is_shut())
    refuse("this server is shutting down");
  else if (connections_ > options.max_sessions * (1 + options.max_spectators) + options.max_queue +
                              options.max_greeting)
    refuse("too many connections: try again in a minute");
  else if (same_address > options.max_sessions_per_address)
    refuse(
        fmt::format("{} connections from {} already: close one first", same_address - 1, address));
}

void Places::forget_connection(const std::string& address) {
  --connections_;
  const auto it = connections_by_address_.find(limited_as(address));
  if (--it->second == 0) connections_by_address_.erase(it);
}

void Places::on_hello(const std::shared_ptr<ClientConnection>& from,
                      std::shared_ptr<Place> newcomer, Hello hello, TimePoint now) {
  const auto host = hello.watch_token.empty() ? presenter_for_spectator(hello)
                                              : presenter(hello.watch_token, hello.token);
  if (host) {
    if (const auto* error = std::get_if<ErrorMessage>(&*host))
      return newcomer->visit().fail(error->code, error->message);
    if (!has_room_for_follower(hello, *std::get<Place*>(*host)))
      return watch(from, *newcomer, *std::get<Place*>(*host), hello, now);
  }
  const auto resumed =
      around_.tokens.read_resume_token(hello.resume_token, around_.options.wall_clock_s());
  if (resumed && hello.version >= wire::version) {
    // The name may by now mean a scene other than the one that was shown.
    if (hello.scene_id.empty() || hello.scene_id == name_in(resumed->scene_id))
      hello.scene_id = resumed->scene_id;
    if (const auto known = find_place(places_, resumed->session_id)) {
      if (resume(from, *newcomer, *known, hello, now)) return;
    } else {
      // The session comes from another server of the fleet, or its grace is over. It keeps its id.
      newcomer->audience().detach();
      const auto place = std::ranges::find(places_, newcomer);
      newcomer = std::make_shared<Place>(around_, *this, resumed->session_id,
                                         newcomer->audience().address());
      *place = newcomer;
      from->belong_to(*newcomer);
    }
  }
  newcomer->visit().on_message(hello, now);
  desk_.on_newcomer(now);
}

bool Places::resume(const std::shared_ptr<ClientConnection>& connection, Place& newcomer,
                    Place& known, const Hello& hello, TimePoint now) {
  const auto choice = desk_.choose(hello);
  const auto* scene_id = std::get_if<std::string>(&choice);
  if (!scene_id || !known.visit().life().resumable()) return false;
  // The session's own scene is in memory. A client that selects another scene starts anew and may
  // have to wait.
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
  if (!known.may_be_watched()) known.audience().end_presentation();
  around_.frames.changed(known);
  return true;
}

std::variant<Place*, ErrorMessage> Places::presenter(const std::string& watch_token,
                                                     const std::string& access_token) {
  const auto refused = [](ErrorCode code, std::string_view why) {
    return ErrorMessage{code, std::string(why), true};
  };
  const auto id = around_.tokens.read_watch_token(watch_token);
  if (!id)
    return refused(ErrorCode::unauthorized, "this link to watch a session is not valid here");
  const auto host = find_place(places_, *id);
  if (!host || !host->visit().life().resumable())
    return refused(ErrorCode::session_ended, "the session of this link has ended");
  if (host->visit().life().state() != VisitState::live)
    return refused(ErrorCode::server_full, "the session of this link is about to start");
  if (!host->may_be_watched())
    return refused(ErrorCode::unauthorized,
                   "the session of this link is not to be watched any more");
  if (!host->audience().presentation().since())
    return refused(ErrorCode::session_ended, "the session of this link does not present now");
  // The leader's link opens the presentation, also to those without an access token. Only a link
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

std::optional<std::variant<Place*, ErrorMessage>> Places::presenter_for_spectator(
    const Hello& hello) {
  const Permit permit = around_.authorize(hello.token);
  const auto only_watches = [&](const std::string& scene_id) {
    return !permit.allows(scene_id, Use::own_session) && permit.allows(scene_id, Use::watch);
  };
  const std::string wanted = around_.scenes.resolve(hello.scene_id);
  const auto ids = around_.scenes.scene_ids();
  if (!hello.scene_id.empty() ? !only_watches(wanted) : std::ranges::none_of(ids, only_watches))
    return std::nullopt;
  Place* first = nullptr;
  for (const auto& place : places_) {
    const auto since = place->audience().presentation().since();
    if (!since || place->visit().life().state() != VisitState::live || !place->may_be_watched())
      continue;
    const std::string& scene_id = place->visit().stream().scene()->facts.scene_id;
    if (!only_watches(scene_id) || (!hello.scene_id.empty() && scene_id != wanted)) continue;
    if (!first || *since < *first->audience().presentation().since()) first = place.get();
  }
  if (first) return first;
  return ErrorMessage{ErrorCode::no_leader, "nobody leads through this scene now", true};
}

bool Places::has_room_for_follower(Hello& hello, Place& host) {
  const std::string& scene_id = host.visit().stream().scene()->facts.scene_id;
  if (!hello.follow || !around_.authorize(hello.token).allows(scene_id, Use::own_session))
    return false;
  hello.scene_id = scene_id;
  return desk_.has_spare_place(hello);
}

void Places::watch(const std::shared_ptr<ClientConnection>& connection, Place& newcomer,
                   Place& host, const Hello& hello, TimePoint now) {
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
                  fmt::format("{} people watch this session already", audience.company()));
  newcomer.audience().detach();
  leave(newcomer);
  const Permit permit = around_.authorize(hello.token);
  connection->watch(host);
  Welcome welcome = welcome_to(visit.stream(), host);
  welcome.may_leave = permit.allows(welcome.scene.scene_id, Use::own_session);
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

void Places::follow(Place& place, ClientConnection& from, const Follow& wish, TimePoint now) {
  for (const auto& other : places_) other->audience().presentation().remove(from);
  if (wish.watch_token.empty()) return;
  const auto refuse = [&](ErrorCode code, std::string why) {
    place.visit().say(ErrorMessage{code, std::move(why), false}, now);
    place.visit().say(Lead{LeadState::ended, {}, 0, {}}, now);
  };
  const auto found = presenter(wish.watch_token, place.visitor().token);
  if (const auto* error = std::get_if<ErrorMessage>(&found))
    return refuse(error->code, error->message);
  Place& host = *std::get<Place*>(found);
  if (&host == &place) return refuse(ErrorCode::bad_message, "a session cannot follow itself");
  const auto scene_of = [](Place& any) { return any.visit().stream().scene()->facts.scene_id; };
  if (scene_of(host) != scene_of(place))
    return place.visit().say(Lead{.state = LeadState::ended,
                                  .name = host.audience().presentation().name(),
                                  .camera = {},
                                  .elsewhere = true},
                             now);
  if (host.audience().full())
    return refuse(ErrorCode::server_full,
                  fmt::format("{} people follow this session already", host.audience().company()));
  host.audience().presentation().add(from.shared_from_this());
}

void Places::stop_following(Place& place) {
  const ClientConnection* const visitor = place.audience().visitor();
  Place* const leader = visitor ? leader_of(*visitor) : nullptr;
  if (!leader) return;
  leader->audience().presentation().remove(*visitor);
  place.send(Lead{LeadState::ended, {}, 0, {}});
}

Place* Places::leader_of(const ClientConnection& follower) {
  const auto leader = std::ranges::find_if(
      places_, [&](const auto& place) { return place->audience().presentation().has(follower); });
  return leader == places_.end() ? nullptr : leader->get();
}

void Places::tell_places(Place& host, TimePoint now) {
  Presentation& presentation = host.audience().presentation();
  if (!presentation.since()) return;
  Company company;
  const auto add = [&](Place& place) {
    if (const auto& camera = place.audience().presentation().camera();
        camera && company.places.size() < most_told_places)
      company.places.push_back(camera->world_from_camera.position);
  };
  if (presentation.tells_places()) {
    add(host);
    for (const auto& place : places_)
      if (const auto* visitor = place->audience().visitor(); visitor && presentation.has(*visitor))
        add(*place);
  }
  if (presentation.tell(company, now)) host.audience().tell(company, now);
}

void Places::leave(Place& place) {
  const auto it = std::ranges::find(places_, &place, [](const auto& p) { return p.get(); });
  if (it == places_.end()) return;
  const TimePoint now = Clock::now();
  if (place.visitor().admitted_at) {
    const VisitStatistics& seen = place.visit().statistics();
    const LogScope about(place.facts());
    log_info({.event = "session_ended"}, "ended after {} frames, {} bytes, {} dropped",
             seen.frames_sent(), seen.bytes_sent(), seen.frames_dropped());
  }
  desk_.leave(place, now);
  around_.frames.withdraw(place);
  place.audience().end_presentation();
  places_.erase(it);
  desk_.admit_waiting(now);
}

void Places::end_revoked(Place& place, const LinkIds& revoked) {
  for (const auto& spectator : place.audience().spectators_by(revoked))
    place.refuse(*spectator, ErrorCode::unauthorized, link_revoked);
  if (!revoked.contains(place.visitor().link_id)) return;
  place.visit().fail(ErrorCode::unauthorized, link_revoked);
  around_.frames.changed(place);
}

void Places::tick() {
  if (stopped_) return;
  around_.options.on_tick();
  const TimePoint now = Clock::now();
  around_.scenes.on_tick(now);
  const RevokedLinks revoked = around_.revoked_links();
  PlaceList gone;
  for (const auto& place : places_) {
    if (!revoked->empty()) end_revoked(*place, *revoked);
    place->on_tick(now, desk_.admitted());
    tell_places(*place, now);
    if (!place->audience().visitor() && place->visit().life().state() == VisitState::closed)
      gone.push_back(place);
  }
  for (const auto& place : gone) leave(*place);
  anybody_looks_ = std::ranges::any_of(
      places_, [](const auto& place) { return place->visit().life().on_show(); });
  machine_.on_tick(places_, desk_.admitted(), now);
  desk_.on_tick(now);
  for (const auto& place : places_) around_.frames.changed(*place);
  around_.metrics.connections.Set(connections_);
  reports_.publish(places_, around_.encoders, around_.metrics);
  tick_timer_.expires_after(tick_interval);
  tick_timer_.async_wait([this](const boost::system::error_code& error) {
    if (!error) tick();
  });
}

void Places::drain(std::chrono::milliseconds deadline) {
  desk_.shut();
  const Drain drain{static_cast<std::uint32_t>(deadline.count())};
  for (const auto& place : places_) place->visit().say(drain, Clock::now());
}

void Places::close_all() {
  for (const auto& place : places_) {
    place->visit().end("the server is shutting down");
    around_.frames.changed(*place);
  }
}

void Places::stop_timer() {
  stopped_ = true;  // cancel() does not take back a handler that is queued: that would re-arm
  tick_timer_.cancel();
}

}  // namespace catgs
