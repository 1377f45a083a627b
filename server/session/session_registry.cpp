#include "server/session/session_registry.h"

#include <algorithm>
#include <random>

#include <boost/asio/post.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "server/net/wire.h"
#include "server/session/log_session.h"

namespace catgs {
namespace {

constexpr std::chrono::milliseconds tick_interval{250};
constexpr std::chrono::milliseconds queue_tell_interval{750};  // once a second, with the tick

/// For people and logs: tells sessions apart, protects nothing.
std::string random_session_id() {
  thread_local std::mt19937 engine{std::random_device{}()};
  return fmt::format("{:08x}", engine());
}

std::string_view state_name(const Session& session) {
  if (session.lost()) return "lost";
  switch (session.state()) {
    case Session::State::awaiting_hello:
      return "awaiting_hello";
    case Session::State::queued:
      return "queued";
    case Session::State::opening:
      return "opening";
    case Session::State::live:
      return "live";
    case Session::State::closed:
      break;
  }
  return "closed";
}

double megapixels(glm::ivec2 size_px) { return 1e-6 * size_px.x * size_px.y; }

nlohmann::json times_json(const SessionUsage& usage) {
  auto times = nlohmann::json::object();
  for (std::size_t i = 0; i < session_time_count; ++i)
    if (const auto p = usage.times(static_cast<SessionTime>(i)).percentiles())
      times[std::string(session_time_names[i])] = {
          {"p50", 1e3 * p->p50}, {"p95", 1e3 * p->p95}, {"p99", 1e3 * p->p99}};
  return times;
}

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
      encoders_(std::move(encoders)),
      authorize_(std::move(authorize)),
      tokens_(std::move(tokens)),
      metrics_(metrics),
      scheduler_(executor_->slots()),
      pace_timer_(io),
      tick_timer_(io),
      cpu_seconds_charged_(process_cpu_seconds()),
      budget_({static_cast<double>(executor_->slots()), static_cast<double>(options_.gpus)},
              options_.min_fps),
      queue_(options_.max_queue) {
  tick();
}

std::shared_ptr<ConnectionListener> SessionRegistry::accept(
    std::shared_ptr<Connection> connection) {
  auto client = std::make_shared<Client>(*this, random_session_id(), connection->peer_address());
  auto peer = std::make_shared<Peer>(*this, std::move(connection));
  boost::asio::post(io_, [this, peer, client] { add(peer, client); });
  return peer;
}

void SessionRegistry::add(const std::shared_ptr<Peer>& peer,
                          const std::shared_ptr<Client>& client) {
  const std::string address = peer->connection().peer_address();
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

void SessionRegistry::forget_connection(const std::string& address) {
  --connections_;
  const auto it = connections_by_address_.find(address);
  if (--it->second == 0) connections_by_address_.erase(it);
}

void SessionRegistry::on_hello(const std::shared_ptr<Peer>& peer, std::shared_ptr<Client> newcomer,
                               Hello hello, TimePoint now) {
  if (!hello.watch_token.empty()) return watch(peer, *newcomer, hello);
  const auto resumed = tokens_.read_resume_token(hello.resume_token, unix_now_s());
  if (resumed && hello.version >= wire::version) {
    if (hello.scene_id.empty()) hello.scene_id = resumed->scene_id;
    if (const auto known = find(resumed->session_id)) {
      // Its own scene is in memory; who wants another one begins anew, and may have to wait.
      const auto choice = choose(hello);
      if (const auto* chosen = std::get_if<Choice>(&choice);
          chosen && known->session().resumable()) {
        auto scene = find_scene(chosen->scene_id, now);
        if (auto* entry = std::get_if<std::shared_ptr<const SceneEntry>>(&scene)) {
          metrics_.sessions_resumed.Increment();
          newcomer->detach();
          remove(*newcomer);
          return known->resume(peer, hello, {std::move(*entry), chosen->encoder}, now);
        }
      }
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
  if (const auto why = authorize_(hello.token, session.scene()->facts.scene_id, Use::watch))
    return refuse(ErrorCode::unauthorized, *why);
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

void SessionRegistry::admit_waiting(TimePoint now) {
  while (!queue_.empty()) {
    const std::string id = queue_.front();
    // It leaves the queue, admitted or refused, or hears that it still has to wait.
    find(id)->session().ask_again(now);
    if (!queue_.empty() && queue_.front() == id) break;
  }
  queue_told_ = now;
  for (const auto& client : clients_)
    if (client->session().state() == Session::State::queued && !client->session().awaits_scene())
      if (const auto position = queue_.join(client->session().id()); position > 1)
        client->session().on_queue_moved(
            {*position, queue_.estimate(*position, static_cast<int>(admitted_))}, now);
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

std::variant<SessionRegistry::Choice, ErrorMessage> SessionRegistry::choose(
    const Hello& hello) const {
  const std::string wanted = hello.scene_id.empty() ? scenes_.default_scene() : hello.scene_id;
  // The token first: a refusal does not depend on what is here.
  if (const auto refusal = authorize_(hello.token, wanted, Use::own_session))
    return ErrorMessage{ErrorCode::unauthorized, *refusal, true};
  if (!scenes_.has(wanted))
    return ErrorMessage{ErrorCode::unknown_scene,
                        fmt::format("there is no scene \"{}\" here", wanted), true};
  for (const Codec codec : hello.decoders)
    for (const auto& encoder : encoders_)
      if (encoder.codec == codec) return Choice{wanted, encoder};
  std::string offered;
  for (const auto& encoder : encoders_) offered += (offered.empty() ? "" : "; ") + encoder.text;
  return ErrorMessage{ErrorCode::no_common_codec,
                      "the client decodes nothing that this server encodes: " + offered, true};
}

bool SessionRegistry::has_place_for(const Client& client, const Hello& hello) const {
  if (draining_ || (!queue_.empty() && queue_.front() != client.session().id())) return false;
  if (static_cast<int>(admitted_) >= options_.max_sessions) return false;
  const FlowWish wish = wish_within(options_.policy, hello.settings, hello.viewport_px);
  return budget_.has_room(demands(), {std::nullopt, megapixels(wish.size_px), wish.fps});
}

std::vector<SessionDemand> SessionRegistry::demands() const {
  std::vector<SessionDemand> demands;
  for (const auto& client : clients_) {
    if (!client->admitted_at()) continue;
    const StreamConfig& config = client->session().config();
    demands.push_back({client->usage().frame_cost(), megapixels(config.size_px), config.fps});
  }
  return demands;
}

AdmissionAnswer SessionRegistry::admit(const Client& client, const Hello& hello) {
  const std::string& id = client.session().id();
  auto choice = choose(hello);
  if (auto* error = std::get_if<ErrorMessage>(&choice)) {
    queue_.leave(id);
    return std::move(*error);
  }
  const auto same_address = std::ranges::count_if(clients_, [&](const auto& c) {
    return c->admitted_at() && c->peer_address() == client.peer_address();
  });
  if (same_address >= options_.max_sessions_per_address) {
    queue_.leave(id);
    return ErrorMessage{ErrorCode::server_full,
                        fmt::format("{} sessions from {} already: close one first", same_address,
                                    client.peer_address()),
                        true};
  }
  if (has_place_for(client, hello)) {
    queue_.leave(id);
    auto& [scene_id, encoder] = std::get<Choice>(choice);
    // Who waits for a scene holds no place: it may come to nothing.
    auto scene = find_scene(scene_id, Clock::now());
    if (const auto* awaited = std::get_if<SceneAwaited>(&scene)) return *awaited;
    if (auto* error = std::get_if<ErrorMessage>(&scene)) return std::move(*error);
    ++admitted_;
    metrics_.sessions_admitted.Increment();
    return Admission{std::get<0>(std::move(scene)), std::move(encoder)};
  }
  if (const auto position = queue_.join(id))
    return QueuePlace{*position, queue_.estimate(*position, static_cast<int>(admitted_))};
  return ErrorMessage{ErrorCode::server_full,
                      fmt::format("all {} places are taken, and {} wait for one: try again in a "
                                  "minute",
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
  if (now - queue_told_ >= queue_tell_interval) admit_waiting(now);
  give_frames();
  publish();
  tick_timer_.expires_after(tick_interval);
  tick_timer_.async_wait([this](const boost::system::error_code& error) {
    if (!error) tick();
  });
}

void SessionRegistry::charge_cpu(TimePoint now) {
  const double used = process_cpu_seconds();
  const double seconds = used - std::exchange(cpu_seconds_charged_, used);
  std::vector<double> busy_seconds;
  for (const auto& client : clients_)
    busy_seconds.push_back(client->usage().take_busy_seconds(now));
  const auto shares = share_out(seconds, busy_seconds);
  for (std::size_t i = 0; i < clients_.size(); ++i) clients_[i]->usage().charge_cpu(shares[i]);
}

void SessionRegistry::publish() {
  auto sessions = nlohmann::json::array();
  std::size_t queued = 0;
  int in_flight = 0;
  int lost = 0;
  std::size_t spectators = 0;
  int stepped_down = 0;
  double target_bits_per_s = 0.0;
  for (const auto& client : clients_) {
    const Session& session = client->session();
    if (session.state() == Session::State::live && !session.lost()) {
      stepped_down += session.flow().steps_down() > 0 ? 1 : 0;
      target_bits_per_s += 1e3 * session.flow().bitrate_kbps();
      metrics_.link_queue_seconds.Observe(
          std::chrono::duration<double>(session.flow().queue_delay()).count());
    }
    queued += client->queued_frames();
    lost += session.lost() ? 1 : 0;
    spectators += client->spectators().size();
    in_flight += session.flow().credit().in_flight();
    sessions.push_back({
        {"id", session.id()},
        {"state", state_name(session)},
        {"paused", session.paused()},
        {"spectators", client->spectators().size()},
        {"scene", session.scene() ? session.scene()->facts.scene_id : ""},
        {"width_px", session.config().size_px.x},
        {"height_px", session.config().size_px.y},
        {"device", session.device() ? nlohmann::json(*session.device()) : nlohmann::json()},
        {"encoder", session.config().encoder},
        {"frames_sent", session.frames_sent()},
        {"frames_dropped", session.frames_dropped()},
        {"bytes_sent", session.bytes_sent()},
        {"frames_in_flight", session.flow().credit().in_flight()},
        {"credit", session.flow().credit().limit()},
        {"base_rtt_us", session.flow().credit().base_rtt().count()},
        {"queue_delay_us", session.flow().queue_delay().count()},
        {"target_bitrate_kbps", session.flow().bitrate_kbps()},
        {"steps_down", session.flow().steps_down()},
        {"tcp_rtt_us", session.flow().link().rtt_us},
        {"tcp_delivery_kbps", session.flow().link().delivery_bits_per_s / 1000},
        {"tcp_window_bytes", session.flow().link().window_bytes},
        {"tcp_unsent_bytes", session.flow().link().unsent_bytes},
        {"frames_queued", client->queued_frames()},
        {"cpu_seconds", client->usage().cpu_seconds()},
        {"gpu_seconds", client->usage().gpu_seconds()},
        {"times_ms", times_json(client->usage())},
    });
  }
  metrics_.connections.Set(connections_);
  metrics_.sessions.Set(admitted_);
  metrics_.sessions_lost.Set(lost);
  metrics_.spectators.Set(static_cast<double>(spectators));
  metrics_.sessions_stepped_down.Set(stepped_down);
  metrics_.target_bits_per_second.Set(target_bits_per_s);
  metrics_.sessions_waiting.Set(static_cast<double>(queue_.size()));
  metrics_.frames_running.Set(scheduler_.running());
  metrics_.frames_queued.Set(static_cast<double>(queued));
  metrics_.frames_in_flight.Set(in_flight);
  const auto demanded = demands();
  const auto load = budget_.load(demanded);
  metrics_.seats.Set(draining_ ? 0 : budget_.seats(demanded, options_.max_sessions));
  metrics_.cpu_budget_used.Set(load.cpus);
  metrics_.gpu_budget_used.Set(load.gpus);
  const std::lock_guard lock(published_mutex_);
  published_ = sessions.dump();
}

std::string SessionRegistry::published_json() const {
  const std::lock_guard lock(published_mutex_);
  return published_;
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
