#include "server/session/session_registry.h"

#include <algorithm>
#include <cmath>

#include <boost/asio/post.hpp>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "server/net/trusted_proxies.h"
#include "server/net/wire.h"
#include "server/session/frame_size.h"
#include "server/session/log_session.h"
#include "server/signed_token.h"

namespace catgs {
namespace {

constexpr std::chrono::milliseconds tick_interval{250};
constexpr std::chrono::seconds time_to_measure{3};             // at most, of one who moves
constexpr std::chrono::milliseconds queue_tell_interval{750};  // once a second, with the tick

double megapixels(glm::ivec2 size_px) { return 1e-6 * size_px.x * size_px.y; }

}  // namespace

std::int64_t unix_now_s() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::seconds>(now).count();
}

SessionRegistry::SessionRegistry(boost::asio::io_context& io, RegistryOptions options,
                                 std::shared_ptr<FrameExecutor> executor, SceneSource& scenes,
                                 std::vector<EncoderChoice> encoders, Authorize authorize,
                                 SessionTokens tokens, Metrics& metrics)
    : io_(io),
      options_(std::move(options)),
      executor_(std::move(executor)),
      scenes_(scenes),
      encoders_(std::move(encoders), options_.encoders),
      authorize_(std::move(authorize)),
      tokens_(std::move(tokens)),
      metrics_(metrics),
      scheduler_(executor_->slots(),
                 options_.devices ? static_cast<int>(options_.devices->views().size()) : 1),
      pace_timer_(io),
      tick_timer_(io),
      cpu_seconds_charged_(process_cpu_seconds()),
      charged_(Clock::now()),
      budget_({static_cast<double>(options_.cpus),
               static_cast<double>(options_.devices ? options_.devices->views().size() : 0)},
              options_.min_fps),
      effort_(options_.cpus, options_.presets),
      queue_(options_.max_queue) {
  tick();
}

std::shared_ptr<ConnectionListener> SessionRegistry::accept(
    std::shared_ptr<Connection> connection) {
  auto client = std::make_shared<Client>(*this, random_id(), connection->peer_address());
  auto peer = std::make_shared<Peer>(*this, std::move(connection));
  boost::asio::post(io_, [this, peer, client] { add(peer, client); });
  return peer;
}

void SessionRegistry::add(const std::shared_ptr<Peer>& peer,
                          const std::shared_ptr<Client>& client) {
  const std::string address = limited_as(peer->connection().peer_address());
  const int same_address = ++connections_by_address_[address];
  ++connections_;
  clients_.push_back(client);
  client->attach(peer);
  const auto refuse = [&](std::string_view why) {
    client->session().fail(ErrorCode::server_full, why);
  };
  if (draining_)
    refuse("this server is shutting down");
  else if (connections_ > options_.max_sessions * (1 + options_.max_spectators) +
                              options_.max_queue + options_.max_greeting)
    refuse("too many connections: try again in a minute");
  else if (same_address > options_.max_sessions_per_address)
    refuse(
        fmt::format("{} connections from {} already: close one first", same_address - 1, address));
}

void SessionRegistry::forget_connection(const std::string& peer_address) {
  --connections_;
  const auto it = connections_by_address_.find(limited_as(peer_address));
  if (--it->second == 0) connections_by_address_.erase(it);
}

void SessionRegistry::on_hello(const std::shared_ptr<Peer>& peer, std::shared_ptr<Client> newcomer,
                               Hello hello, TimePoint now) {
  if (!hello.watch_token.empty()) return watch(peer, *newcomer, hello);
  const auto resumed = tokens_.read_resume_token(hello.resume_token, options_.wall_clock_s());
  if (resumed && hello.version >= wire::version) {
    if (hello.scene_id.empty()) hello.scene_id = resumed->scene_id;
    if (const auto known = find(resumed->session_id)) {
      if (resume(peer, *newcomer, *known, hello, now)) return;
    } else {
      // It comes from another server of the fleet, or comes late: its id goes on.
      newcomer->detach();
      const auto place = std::ranges::find(clients_, newcomer);
      newcomer = std::make_shared<Client>(*this, resumed->session_id, newcomer->peer_address());
      *place = newcomer;
      newcomer->attach(peer);
    }
  }
  newcomer->session().on_message(hello, now);
  // It may ask for less than those who came before.
  if (queue_.size() > 1) ask_waiting(now);
}

bool SessionRegistry::resume(const std::shared_ptr<Peer>& peer, Client& newcomer, Client& known,
                             const Hello& hello, TimePoint now) {
  const auto choice = choose(hello);
  const auto* scene_id = std::get_if<std::string>(&choice);
  if (!scene_id || !known.session().resumable()) return false;
  // Its own scene is in memory; who wants another one begins anew, and may have to wait.
  auto found = find_scene(*scene_id, now);
  auto* scene = std::get_if<std::shared_ptr<const SceneEntry>>(&found);
  if (!scene) return false;
  auto encoder = encoders_.renew(known.encoder(), hello.decoders, now);
  if (!encoder) return false;
  metrics_.sessions_resumed.Increment();
  newcomer.detach();
  remove(newcomer);
  Admission admission{std::move(*scene), encoder->encoder, known.session().effort()};
  known.use_encoder(*std::move(encoder));
  known.resume(peer, hello, std::move(admission), now);
  return true;
}

void SessionRegistry::watch(const std::shared_ptr<Peer>& peer, Client& newcomer,
                            const Hello& hello) {
  const auto refuse = [&](ErrorCode code, std::string_view why) {
    newcomer.session().fail(code, why);
  };
  const auto id = tokens_.read_watch_token(hello.watch_token);
  if (!id) return refuse(ErrorCode::unauthorized, "this link to watch a session is not valid here");
  const auto host = find(*id);
  if (!host || !host->session().resumable())
    return refuse(ErrorCode::session_ended, "the session of this link has ended");
  const Session& session = host->session();
  if (const auto why = authorize_(hello.token)(session.scene()->facts.scene_id, Use::watch))
    return refuse(ErrorCode::unauthorized, *why);
  if (!host->may_be_watched())
    return refuse(ErrorCode::unauthorized,
                  "the session of this link is not to be watched any more");
  if (session.state() != Session::State::live)
    return refuse(ErrorCode::server_full, "the session of this link is about to start");
  if (std::ranges::count(hello.decoders, session.config().codec) == 0)
    return refuse(ErrorCode::no_common_codec,
                  "the client cannot decode what the session of this link is encoded as");
  if (host->spectators().full())
    return refuse(ErrorCode::server_full,
                  fmt::format("{} people watch this session already", host->spectators().size()));
  newcomer.detach();
  remove(newcomer);
  host->add_spectator(peer);
}

void SessionRegistry::remove(const Client& client) {
  const auto it = std::ranges::find(clients_, &client, [](const auto& c) { return c.get(); });
  if (it == clients_.end()) return;
  const TimePoint now = Clock::now();
  if (const auto admitted_at = client.admitted_at()) {
    --admitted_;
    queue_.session_ended(now - *admitted_at);
    const Session& session = client.session();
    const LogSession about(session.id());
    spdlog::info("ended after {} frames, {} bytes, {} dropped", session.frames_sent(),
                 session.bytes_sent(), session.frames_dropped());
  }
  queue_.leave(client.session().id());
  (*it)->spectators().dismiss_all();
  clients_.erase(it);
  admit_waiting(now);
}

void SessionRegistry::ask_waiting(TimePoint now) {
  measuring_ = false;
  for (const auto& [id, since] : queue_.waiting()) {
    Session& session = find(id)->session();
    if (now - since >= options_.policy.longest_wait) {
      queue_.leave(id);
      session.fail(ErrorCode::server_full,
                   fmt::format("no place came free within {} minutes: try again later",
                               std::chrono::floor<std::chrono::minutes>(now - since).count()));
      continue;
    }
    const Room room = offer_for(session.waiting_hello(), demands()).room;
    measuring_ = room == Room::unknown;
    if (measuring_ || (room == Room::no && now - since >= options_.policy.overtaken_at_most))
      return;
    if (room == Room::no) continue;
    // It leaves the queue, admitted or refused, or hears that it still has to wait.
    turn_ = id;
    session.ask_again(now);
    turn_.clear();
  }
}

void SessionRegistry::admit_waiting(TimePoint now) {
  ask_waiting(now);
  queue_told_ = now;
  int position = 0;
  for (const auto& [id, since] : queue_.waiting())
    find(id)->session().on_queue_moved(place_in_queue(++position), now);
}

QueuePlace SessionRegistry::place_in_queue(int position) const {
  return {position, measuring_ ? time_to_measure * position
                               : queue_.estimate(position, static_cast<int>(admitted_))};
}

/// Once may be chance, as a driver that is just being reset; without a frame in between it is none.
void SessionRegistry::on_view_refused(const std::string& why) {
  if (++device_failures_ > 1) options_.on_devices_lost(why);
}

std::shared_ptr<Client> SessionRegistry::find(std::string_view session_id) const {
  const auto it = std::ranges::find_if(
      clients_, [&](const auto& client) { return client->session().id() == session_id; });
  return it == clients_.end() ? nullptr : *it;
}

SceneAnswer SessionRegistry::find_scene(const std::string& scene_id, TimePoint now) {
  if (scenes_.has(scene_id)) return scenes_.want(scene_id, now);
  return ErrorMessage{ErrorCode::unknown_scene,
                      fmt::format("there is no scene \"{}\" here", scene_id), false};
}

std::variant<std::string, ErrorMessage> SessionRegistry::choose(const Hello& hello) const {
  const std::string wanted = hello.scene_id.empty() ? scenes_.default_scene() : hello.scene_id;
  // The token first: a refusal does not depend on what is here.
  if (const auto refusal = authorize_(hello.token)(wanted, Use::own_session))
    return ErrorMessage{ErrorCode::unauthorized, *refusal, true};
  if (!scenes_.has(wanted))
    return ErrorMessage{ErrorCode::unknown_scene,
                        fmt::format("there is no scene \"{}\" here", wanted), true};
  if (!encoders_.serves(hello.decoders))
    return ErrorMessage{ErrorCode::no_common_codec,
                        "the client decodes nothing that this server encodes: " + encoders_.offer(),
                        true};
  return wanted;
}

AdmissionBudget::Offer SessionRegistry::offer_for(const Hello& hello,
                                                  std::span<const SessionDemand> present) const {
  if (draining_ || static_cast<int>(admitted_) >= options_.max_sessions) return {Room::no};
  const FlowWish wish = wish_within(options_.policy, hello.settings, hello.viewport_px);
  return budget_.offer(present, {std::nullopt, megapixels(wish.size_px), wish.fps});
}

std::vector<Client*> SessionRegistry::admitted_clients() const {
  std::vector<Client*> admitted;
  for (const auto& client : clients_)
    if (client->admitted_at()) admitted.push_back(client.get());
  return admitted;
}

std::vector<SessionDemand> SessionRegistry::demands() const {
  const TimePoint now = Clock::now();
  std::vector<SessionDemand> demands;
  for (const Client* client : admitted_clients()) {
    const Session& session = client->session();
    const bool fresh = now - *client->admitted_at() < time_to_measure && !session.rests(now);
    demands.push_back({client->usage().frame_cost(), megapixels(session.moving_size_px()),
                       session.fps(), fresh, session.pixel_share()});
  }
  return demands;
}

void SessionRegistry::set_pixel_share(Client& client, double share) {
  Session& session = client.session();
  const double work = frame_work(megapixels(session.moving_size_px()));
  session.use_pixel_share(share);
  const glm::ivec2 size_px = session.moving_size_px();
  client.usage().scale_frame_cost(frame_work(megapixels(size_px)) / work);
  const LogSession about(session.id());
  spdlog::debug("its pictures are {}x{} from now on: there is room for {:.0f} % of their pixels",
                size_px.x, size_px.y, 100.0 * share);
}

void SessionRegistry::grow_pictures() {
  if (!queue_.empty()) return;
  if (const auto growth = budget_.growth(demands()))
    set_pixel_share(*admitted_clients()[growth->session], growth->pixel_share);
}

AdmissionAnswer SessionRegistry::admit(Client& client, const Hello& hello) {
  const std::string& id = client.session().id();
  auto choice = choose(hello);
  if (auto* error = std::get_if<ErrorMessage>(&choice)) {
    queue_.leave(id);
    return std::move(*error);
  }
  const std::string address = limited_as(client.peer_address());
  const auto same_address = std::ranges::count_if(clients_, [&](const auto& c) {
    return c->admitted_at() && limited_as(c->peer_address()) == address;
  });
  if (same_address >= options_.max_sessions_per_address) {
    queue_.leave(id);
    return ErrorMessage{
        ErrorCode::server_full,
        fmt::format("{} sessions from {} already: close one first", same_address, address), true};
  }
  const bool its_turn = queue_.empty() || turn_ == id;
  const auto present = admitted_clients();
  const auto offer =
      its_turn ? offer_for(hello, demands()) : AdmissionBudget::Offer{.room = Room::no};
  if (its_turn) measuring_ = offer.room == Room::unknown;
  if (offer.room == Room::yes) {
    // Who waits for a scene holds no place: it may come to nothing.
    auto scene = find_scene(std::get<std::string>(choice), Clock::now());
    if (!std::holds_alternative<std::shared_ptr<const SceneEntry>>(scene)) queue_.leave(id);
    if (const auto* awaited = std::get_if<SceneAwaited>(&scene)) return *awaited;
    if (auto* error = std::get_if<ErrorMessage>(&scene)) return std::move(*error);
    if (auto encoder = encoders_.grant(hello.decoders, Clock::now())) {
      queue_.leave(id);
      ++admitted_;
      metrics_.sessions_admitted.Increment();
      for (std::size_t i = 0; i < offer.kept.size(); ++i)
        if (offer.kept[i] < 1.0)
          set_pixel_share(*present[i], offer.kept[i] * present[i]->session().pixel_share());
      const glm::ivec2 size_px =
          wish_within(options_.policy, hello.settings, hello.viewport_px).size_px;
      Admission admission{std::get<0>(std::move(scene)), encoder->encoder,
                          effort_.initial(static_cast<int>(admitted_),
                                          scaled_size(size_px, std::sqrt(offer.pixel_share))),
                          offer.pixel_share};
      client.use_encoder(*std::move(encoder));
      return admission;
    }
    if (client.session().state() != Session::State::queued)
      spdlog::info("{} waits for a video encoder: all are taken", client.peer_address());
  }
  if (const auto position = queue_.join(id, Clock::now())) return place_in_queue(*position);
  return ErrorMessage{
      ErrorCode::server_full,
      measuring_
          ? fmt::format("it is being measured what sessions cost here, and {} wait for it: try "
                        "again in {} s",
                        queue_.size(), time_to_measure.count())
          : fmt::format("all {} places are taken, and {} wait for one: try again in a minute",
                        admitted_, queue_.size()),
      true};
}

void SessionRegistry::give_frames() {
  if (stopped_) return;
  while (scheduler_.has_free_slot()) {
    candidates_.clear();
    candidate_clients_.clear();
    for (const auto& client : clients_) {
      if (const auto candidate = client->session().next_frame()) {
        candidates_.push_back(*candidate);
        candidate_clients_.push_back(client.get());
      }
    }
    if (candidates_.empty()) return;
    const TimePoint now = Clock::now();
    const auto chosen = scheduler_.choose(candidates_, now);
    if (!chosen) {
      const auto next = std::ranges::min_element(candidates_, {}, &FrameCandidate::ready);
      pace_timer_.expires_at(next->ready);
      pace_timer_.async_wait([this](const boost::system::error_code& error) {
        if (!error) give_frames();
      });
      return;
    }
    candidate_clients_[*chosen]->start_frame(candidates_[*chosen], now);
  }
}

void SessionRegistry::tick() {
  if (stopped_) return;
  options_.on_tick();
  const TimePoint now = Clock::now();
  scenes_.on_tick(now);
  std::vector<std::shared_ptr<Client>> gone;
  for (const auto& client : clients_) {
    client->on_tick(now);
    if (!client->connected() && client->session().state() == Session::State::closed)
      gone.push_back(client);
  }
  for (const auto& client : gone) remove(*client);
  charge_cpu(now);
  report_loads();
  control_effort(now);
  grow_pictures();
  if (measuring_ || now - queue_told_ >= queue_tell_interval) admit_waiting(now);
  give_frames();
  publish();
  tick_timer_.expires_after(tick_interval);
  tick_timer_.async_wait([this](const boost::system::error_code& error) {
    if (!error) tick();
  });
}

void SessionRegistry::drain(std::chrono::milliseconds deadline) {
  draining_ = true;
  for (const auto& client : clients_) client->session().drain(deadline);
}

void SessionRegistry::close_all() {
  for (const auto& client : clients_) client->session().end("the server is shutting down");
}

void SessionRegistry::stop_timers() {
  stopped_ = true;  // cancel() does not take back a handler that is queued: that would re-arm
  pace_timer_.cancel();
  tick_timer_.cancel();
}

}  // namespace catgs
