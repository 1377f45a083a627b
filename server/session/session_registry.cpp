#include "server/session/session_registry.h"

#include <algorithm>
#include <random>

#include <boost/asio/post.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "server/session/log_session.h"

namespace catgs {
namespace {

constexpr std::chrono::milliseconds tick_interval{250};

/// For people and logs: tells sessions apart, protects nothing.
std::string random_session_id() {
  thread_local std::mt19937 engine{std::random_device{}()};
  return fmt::format("{:08x}", engine());
}

std::string_view name_of(Session::State state) {
  switch (state) {
    case Session::State::awaiting_hello:
      return "awaiting_hello";
    case Session::State::opening:
      return "opening";
    case Session::State::live:
      return "live";
    case Session::State::closed:
      break;
  }
  return "closed";
}

}  // namespace

SessionRegistry::SessionRegistry(boost::asio::io_context& io, RegistryOptions options,
                                 std::shared_ptr<FrameExecutor> executor,
                                 std::vector<std::shared_ptr<const SceneEntry>> scenes,
                                 std::vector<EncoderChoice> encoders, Authorize authorize,
                                 Metrics& metrics)
    : io_(io),
      options_(std::move(options)),
      executor_(std::move(executor)),
      scenes_(std::move(scenes)),
      encoders_(std::move(encoders)),
      authorize_(std::move(authorize)),
      metrics_(metrics),
      scheduler_(executor_->slots()),
      pace_timer_(io),
      tick_timer_(io) {
  tick();
}

std::shared_ptr<ConnectionListener> SessionRegistry::accept(
    std::shared_ptr<Connection> connection) {
  auto client = std::make_shared<Client>(*this, std::move(connection), random_session_id());
  boost::asio::post(io_, [this, client] { add(client); });
  return client;
}

void SessionRegistry::add(const std::shared_ptr<Client>& client) {
  const std::string address = client->connection().peer_address();
  const auto same_address = std::ranges::count_if(
      clients_, [&](const auto& c) { return c->connection().peer_address() == address; });
  clients_.push_back(client);
  if (draining_)
    client->session().fail(ErrorCode::server_full, "this server is shutting down");
  else if (clients_.size() > static_cast<std::size_t>(options_.max_sessions + options_.max_waiting))
    client->session().fail(ErrorCode::server_full, "too many connections: try again in a minute");
  else if (same_address >= options_.max_sessions_per_address)
    client->session().fail(
        ErrorCode::server_full,
        fmt::format("{} sessions from {} already: close one first", same_address, address));
}

void SessionRegistry::remove(const Client& client) {
  const auto it = std::ranges::find(clients_, &client, [](const auto& c) { return c.get(); });
  if (it == clients_.end()) return;
  if (client.admitted()) {
    --admitted_;
    const Session& session = client.session();
    const LogSession about(session.id());
    spdlog::info("ended after {} frames, {} bytes, {} dropped", session.frames_sent(),
                 session.bytes_sent(), session.frames_dropped());
  }
  clients_.erase(it);
}

std::shared_ptr<const SceneEntry> SessionRegistry::find_scene(const std::string& scene_id) const {
  if (scene_id.empty()) return scenes_.front();
  const auto it = std::ranges::find_if(
      scenes_, [&](const auto& scene) { return scene->facts.scene_id == scene_id; });
  return it == scenes_.end() ? nullptr : *it;
}

std::variant<Admission, ErrorMessage> SessionRegistry::admit(const Hello& hello) {
  const auto scene = find_scene(hello.scene_id);
  // The token first: a refusal does not depend on what is here.
  const std::string& wanted_scene = scene ? scene->facts.scene_id : hello.scene_id;
  if (const auto refusal = authorize_(hello.token, wanted_scene))
    return ErrorMessage{ErrorCode::unauthorized, *refusal, true};
  if (!scene)
    return ErrorMessage{ErrorCode::unknown_scene,
                        fmt::format("there is no scene \"{}\" here", hello.scene_id), true};
  if (static_cast<int>(admitted_) >= options_.max_sessions)
    return ErrorMessage{
        ErrorCode::server_full,
        fmt::format("all {} places are taken: try again in a minute", options_.max_sessions), true};
  for (const Codec codec : hello.decoders)
    for (const auto& encoder : encoders_)
      if (encoder.codec == codec) return Admission{scene, encoder};
  std::string offered;
  for (const auto& encoder : encoders_) offered += (offered.empty() ? "" : "; ") + encoder.text;
  return ErrorMessage{ErrorCode::no_common_codec,
                      "the client decodes nothing that this server encodes: " + offered, true};
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
    const auto chosen = FrameScheduler::choose(candidates_, now);
    if (!chosen) {
      const auto next = std::ranges::min_element(candidates_, {}, &FrameCandidate::ready);
      pace_timer_.expires_at(next->ready);
      pace_timer_.async_wait([this](const boost::system::error_code& error) {
        if (!error) give_frames();
      });
      return;
    }
    candidate_clients_[*chosen]->start_frame(now);
  }
}

void SessionRegistry::tick() {
  if (stopped_) return;
  const TimePoint now = Clock::now();
  for (const auto& client : clients_) client->session().on_tick(now);
  give_frames();
  publish();
  tick_timer_.expires_after(tick_interval);
  tick_timer_.async_wait([this](const boost::system::error_code& error) {
    if (!error) tick();
  });
}

void SessionRegistry::publish() {
  auto sessions = nlohmann::json::array();
  std::size_t queued = 0;
  int in_flight = 0;
  for (const auto& client : clients_) {
    const Session& session = client->session();
    queued += client->connection().queued_frames();
    in_flight += session.credit().in_flight();
    sessions.push_back({
        {"id", session.id()},
        {"state", name_of(session.state())},
        {"paused", session.paused()},
        {"scene", session.scene() ? session.scene()->facts.scene_id : ""},
        {"width_px", session.config().size_px.x},
        {"height_px", session.config().size_px.y},
        {"device", session.device() ? nlohmann::json(*session.device()) : nlohmann::json()},
        {"encoder", session.config().encoder},
        {"frames_sent", session.frames_sent()},
        {"frames_dropped", session.frames_dropped()},
        {"bytes_sent", session.bytes_sent()},
        {"frames_in_flight", session.credit().in_flight()},
        {"credit", session.credit().limit()},
        {"base_rtt_us", session.credit().base_rtt().count()},
        {"frames_queued", client->connection().queued_frames()},
    });
  }
  metrics_.connections.Set(static_cast<double>(clients_.size()));
  metrics_.sessions.Set(admitted_);
  metrics_.frames_running.Set(scheduler_.running());
  metrics_.frames_queued.Set(static_cast<double>(queued));
  metrics_.frames_in_flight.Set(in_flight);
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

void SessionRegistry::stop_timers() {
  stopped_ = true;  // cancel() does not take back a handler that is queued: that would re-arm
  pace_timer_.cancel();
  tick_timer_.cancel();
}

}  // namespace catgs
