#include "server/server.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <fmt/format.h>
#include <unistd.h>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "server/access/access.h"
#include "server/access/signed_token.h"
#include "server/base/liveness.h"
#include "server/base/log.h"
#include "server/base/metrics.h"
#include "server/base/prompt_thread.h"
#include "server/base/scene_id.h"
#include "server/base/stop_while_loading.h"
#include "server/base/watchdog.h"
#include "server/counts/visit_book.h"
#include "server/counts/visits_page.h"
#include "server/films/film_studio.h"
#include "server/frame_path.h"
#include "server/net/net_server.h"
#include "server/net/static_files.h"
#include "server/net/visitor_address.h"
#include "server/scenes/media_api.h"
#include "server/scenes/scene_api.h"
#include "server/scenes/scene_library.h"
#include "server/scenes/sidecar_saver.h"
#include "server/schedule/pool_executor.h"
#include "server/schedule/watched_executor.h"
#include "server/visit/places.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto quick_stop_deadline = 1000ms;
constexpr auto farewell_time = 500ms;  // for close frames, after the deadline
constexpr auto drain_poll = 20ms;
// Two or three frames at a time keep a GPU busy. More would only take turns.
constexpr int render_threads_per_gpu = 3;

constexpr std::string_view no_client_page =
    "CaT-GS server: the browser client was not built with this server.\n"
    "Configure with -DCATGS_WEB=ON, or give --client-dir.\n";

/// The client of --client-dir, or the one that was built with this program.
StaticFiles find_client(const std::string& client_dir) {
  const auto folder = client_dir.empty() ? built_client() : std::filesystem::path(client_dir);
  return folder.empty() ? StaticFiles() : StaticFiles(folder);
}

/// The page asks for its document at its own address with ".json" added.
HttpResponse charts_page(const StaticFiles& client, HttpRequest request) {
  request.path = "/charts.html";
  HttpResponse page = client.respond(request);
  if (page.status == 404)
    return text_response(404, "404: this page was not built; /visits.json has the counts\n");
  // Script and style are inside the page.
  page.policy =
      "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
      "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'";
  return page;
}

VisitOptions visit_options(const ServerConfig& config) {
  VisitOptions options;
  options.policy.idle_timeout = std::chrono::seconds(config.idle_timeout_s);
  options.policy.default_fps = config.fps;
  options.policy.detail_px = static_cast<float>(config.detail_px);
  options.policy.default_bitrate_kbps = config.bitrate_kbps;
  options.max_sessions = config.max_sessions;
  options.max_sessions_per_address = config.max_sessions_per_address;
  options.max_queue = config.max_queue;
  options.max_spectators = config.max_spectators;
  options.min_fps = config.min_fps;
  for (int i = 0; i < static_cast<int>(std::size(effort_presets)); ++i)
    if (effort_presets[static_cast<std::size_t>(i)].name == config.x264_preset)
      options.presets = {i, i};
  return options;
}

/// The key of what this server signs for its own clients. Servers of a fleet have it in common.
std::string own_key(const ServerConfig& config) {
  if (!config.resume_key_file.empty())
    return read_key_file("--resume-key-file", config.resume_key_file);
  if (!config.token_key_file.empty())
    return read_key_file("--token-key-file", config.token_key_file);
  return random_key();
}

}  // namespace

struct Server::State {
  State(const ServerConfig& configuration, const ServerParts& parts)
      : config(configuration),
        liveness(parts.liveness_clock),
        access(config.token_file, config.token_key_file, config.open, config.revoked_links,
               own_key(config)),
        client(find_client(config.client_dir)),
        net(net_options()),
        pool(std::make_shared<ThreadPool>(config.threads)),
        devices(std::make_shared<DeviceSet>(config.devices)),
        stop{.signals = boost::asio::signal_set(io), .timer = boost::asio::steady_timer(io)} {}

  NetOptions net_options();
  /// /healthz and /readyz, on both ports: probes of the admin port need neither TLS nor a host
  /// name.
  [[nodiscard]] std::optional<HttpResponse> respond_to_probe(const HttpRequest& request) const;
  HttpResponse respond(const HttpRequest& request);
  HttpResponse respond_admin(const HttpRequest& request);
  void count_visits();
  void remove_stale_files() const;
  void print_banner() const;
  void wait_for_signal();
  /// Ends readiness. Clients are told after `wait` and closed after a further `deadline`.
  void begin_stop(std::chrono::milliseconds wait, std::chrono::milliseconds deadline);
  /// This server cannot serve any more: clients are told, and run() throws.
  void give_up(const std::string& why);
  void drain(std::chrono::milliseconds deadline);
  /// Calls `then` when no client is connected or saving, at the latest at `deadline`.
  void when_empty(TimePoint deadline, std::function<void()> then);
  void finish_stop();

  const ServerConfig config;
  Liveness liveness;
  AccessControl access;
  Metrics metrics;
  const StaticFiles client;
  std::atomic<bool> ready{false};
  NetServer net;
  boost::asio::io_context io{1};  // outlives the pool, whose tasks post to it
  std::shared_ptr<ThreadPool> pool;
  std::shared_ptr<DeviceSet> devices;  // all scenes' Views are counted in one
  std::optional<VisitCounts> counts;
  std::optional<VisitBook> book;
  std::unique_ptr<SceneLibrary> scenes;
  struct {
    std::unique_ptr<SceneApi> scenes;
    std::unique_ptr<MediaApi> media;
  } api;
  std::optional<VisitsPage> visits_page;
  std::vector<EncoderChoice> encoders;
  std::unique_ptr<FramePath> frames;
  std::unique_ptr<Places> places;
  struct {
    std::unique_ptr<SidecarSaver> saver;
    std::unique_ptr<FilmStudio> films;
  } authors;  // their threads use what is above
  struct {
    std::optional<StopWhileLoading> while_loading{std::in_place};
    boost::asio::signal_set signals;
    boost::asio::steady_timer timer;
    bool begun = false;
    std::string failure{};  // why run() ends; empty: it was asked to
  } stop;
};

NetOptions Server::State::net_options() {
  NetOptions options;
  options.listen = {config.bind, config.port};
  options.http = [this](const HttpRequest& request) { return respond(request); };
  options.uploads.refusal = [this](const HttpRequest& request) {
    if (FilmStudio::cancels(request)) return authors.films->refuse_cancel(request);
    return MediaApi::is_file(request.path) ? api.media->refuse_upload(request)
                                           : api.scenes->refuse_upload(request);
  };
  options.uploads.most_bytes = [](std::string_view path) {
    if (MediaApi::is_file(path)) return max_media_bytes;
    return SceneApi::orders_film({path, {}}) ? max_upload_bytes : max_sent_sidecar_bytes;
  };
  options.uploads.take = [this](const HttpRequest& request, std::string body,
                                std::shared_ptr<const UploadPlace> place) {
    if (FilmStudio::cancels(request)) return authors.films->cancel(request);
    if (MediaApi::is_file(request.path))
      return api.media->save(request, std::move(body), std::move(place));
    if (SceneApi::orders_film(request))
      return authors.films->order(api.scenes->saved_scene(request), api.scenes->author_of(request),
                                  std::move(body), std::move(place));
    return authors.saver->save(api.scenes->saved_scene(request), std::move(body),
                               {std::string(request.if_match), std::string(request.if_none_match)},
                               std::move(place));
  };
  options.uploads.on_full = [this] { metrics.uploads_refused.Increment(); };
  options.accept = [this](std::shared_ptr<Connection> connection) {
    return places->accept(std::move(connection));
  };
  options.on_refused = [this](const LogFacts& facts, const std::string& text) {
    metrics.requests_refused.Increment();
    log_refusal(facts, text);
  };
  options.on_failed = [this] {
    boost::asio::post(io, [this] { give_up("the network thread failed"); });
  };
  options.asks_for_tokens = config.asks_for_tokens();
  options.allowed_origins = config.allow_origins;
  options.embed_origins = config.embed_origins;
  options.media_origins = config.media_origins;
  options.trusted_proxies = config.trusted_proxies;
  options.sessions_of_an_address = config.max_sessions_per_address;
  options.tls_certificate = config.tls_cert;
  options.tls_key = config.tls_key;
  if (config.admin_bind != "off") {
    options.admin = true;
    options.admin_listen = parse_endpoint(config.admin_bind);
    options.admin_http = [this](const HttpRequest& request) { return respond_admin(request); };
  }
  return options;
}

std::optional<HttpResponse> Server::State::respond_to_probe(const HttpRequest& request) const {
  if (request.path != "/healthz" && request.path != "/readyz") return std::nullopt;
  if (const std::string complaint = liveness.complaint(); !complaint.empty())
    return text_response(503, complaint + "\n");
  if (request.path == "/healthz") return text_response(200, "ok\n");
  return ready ? text_response(200, "ready\n") : text_response(503, "not ready\n");
}

HttpResponse Server::State::respond(const HttpRequest& request) {
  if (auto answer = respond_to_probe(request)) return *std::move(answer);
  if (auto answer = api.media->respond(request)) return *std::move(answer);
  if (auto answer = api.scenes->respond(request)) return *std::move(answer);
  if (auto answer = authors.films->respond(request)) return *std::move(answer);
  if (client.empty() && request.path == "/") return text_response(200, std::string(no_client_page));
  if (!client.empty() && (request.path == "/" || request.path == "/index.html"))
    return client.respond_with_head(request, api.scenes->preview(request));
  return client.respond(request);
}

HttpResponse Server::State::respond_admin(const HttpRequest& request) {
  if (auto answer = respond_to_probe(request)) return *std::move(answer);
  for (const auto& [device, views] : devices->views()) metrics.set_views(device, views);
  for (const Liveness::Loop& loop : liveness.loops())
    metrics.set_loop_stalled(std::string(loop.name), loop.stalled);
  if (request.path == "/metrics")
    return text_response(200, metrics.scrape(), "text/plain; version=0.0.4; charset=utf-8");
  if (request.path == "/api/metrics") return text_response(200, metrics.json(), "application/json");
  if (request.path == "/api/sessions")
    return text_response(200, places->published_json(), "application/json");
  if (visits_page && request.path == "/visits") return charts_page(client, request);
  if (visits_page)
    if (auto answer = visits_page->respond(request)) return *std::move(answer);
  return text_response(404, "404: /metrics, /visits, /api/metrics and /api/sessions are here\n");
}

void Server::State::count_visits() {
  if (config.visit_counts == "off") return;
  counts.emplace(unix_now_s);
  book.emplace(config.visit_counts == "memory" ? "" : config.visit_counts, *counts);
  visits_page.emplace(*book, unix_now_s, [this](const std::string& scene_id) {
    const auto listing = scenes->listing();
    const auto scene = std::ranges::find(*listing, scene_id, &SceneLibrary::Listing::id);
    return scene != listing->end() && scene->tours ? scene->tours->titles : nullptr;
  });
}

/// What killed servers have left where authors save.
void Server::State::remove_stale_files() const {
  std::set<std::filesystem::path> folders(config.scene_folders.begin(), config.scene_folders.end());
  for (const auto& scene : *scenes->listing())
    if (!scene.sidecar.empty()) folders.insert(scene.sidecar.parent_path());
  authors.saver->remove_stale_files_in(std::move(folders));
}

Server::Server(const ServerConfig& config, const ServerParts& parts)
    : state_(std::make_unique<State>(config, parts)) {
  State& s = *state_;
  s.count_visits();
  s.scenes = std::make_unique<SceneLibrary>(
      s.config, RendererOptions{.kind = s.config.renderer, .pool = s.pool, .devices = s.devices},
      s.io, s.metrics);
  s.authors.saver = std::make_unique<SidecarSaver>(*s.scenes, s.io, s.config.media_origins);
  if (!s.config.token_key_file.empty()) s.remove_stale_files();  // others save nothing
  s.encoders = usable_encoders(s.config.encoder, probe_encoders());
  auto authorize = [&s](const std::string& token) {
    const auto resolve = [&s](auto wish) { return s.scenes->resolve(wish); };
    return s.access.permit(token, unix_now_s(), resolve);
  };
  s.api.scenes = std::make_unique<SceneApi>(*s.scenes, authorize);
  const auto ended = [&s](std::string_view token_id) { return s.access.ended(token_id); };
  s.api.media = std::make_unique<MediaApi>(
      MediaApi::Parts{*s.scenes, authorize, ended, s.access.own_key(), unix_now_s});
  VisitOptions options = visit_options(s.config);
  PoolExecutor::Pools pools{s.pool};
  for (const auto& [device, views] : s.devices->views())
    pools.render.emplace(device, std::make_shared<ThreadPool>(render_threads_per_gpu));
  options.cpus = s.pool->threads();
  options.on_tick = [&s] { s.liveness.session_moved(); };
  std::shared_ptr<FrameExecutor> executor = std::make_shared<PoolExecutor>(std::move(pools));
  if (parts.wrap) executor = parts.wrap(std::move(executor));
  executor = std::make_shared<WatchedExecutor>(std::move(executor), s.liveness);
  s.frames = std::make_unique<FramePath>(
      s.io, executor, static_cast<int>(s.devices->views().size()),
      [&s](const auto& why) { s.give_up("no device renders any more: " + why); }, s.metrics);
  s.places = std::make_unique<Places>(
      VisitContext{s.io, options, executor, *s.devices, *s.frames, *s.scenes, s.encoders, authorize,
                   SessionTokens(s.access.own_key()), s.metrics, s.counts ? &*s.counts : nullptr,
                   [&s] { return s.access.revoked_links(); }});
  s.authors.films = std::make_unique<FilmStudio>(FilmStudio::Surroundings{
      s.io, [&s](const auto& id, bool again) { return s.scenes->lease(id, again); },
      [&s] { return s.places->anybody_looks(); }, ended});
}

Server::~Server() {
  // The network thread hands connections to the places, which are destroyed before the network.
  if (state_) state_->net.stop();
}

void Server::run() {
  State& s = *state_;
  s.stop.signals.add(SIGINT);
  s.stop.signals.add(SIGTERM);
  s.stop.while_loading.reset();
  s.wait_for_signal();
  s.net.start();
  run_promptly();  // after the other threads were started
  s.ready = true;
  s.print_banner();
  const Watchdog watchdog(s.liveness, [](const std::string& why) {
    log_event(spdlog::level::critical, {.event = "stalled"},
              "{}; the process ends, so that its supervisor restarts it", why);
    ::_exit(1);
  });
  s.io.run();
  log_info({.event = "stopped"}, "stopped");
  if (!s.stop.failure.empty()) throw std::runtime_error(s.stop.failure);
}

void Server::stop() {
  boost::asio::post(state_->io, [this] { state_->begin_stop(0ms, quick_stop_deadline); });
}

int Server::port() const { return state_->net.port(); }
int Server::admin_port() const { return state_->net.admin_port(); }

void Server::State::print_banner() const {
  log_info({.event = "renderer"}, "renderer: {}", scenes->renderer_text());
  log_info({.event = "encoder"}, "encoder: {}", encoders.front().text);
  if (net.admin_port() != 0)
    log_info({.event = "metrics"}, "metrics: http://{}/metrics",
             fmt::format("{}:{}", parse_endpoint(config.admin_bind).address, net.admin_port()));
  const std::string rest =
      fmt::format(":{}/{}", net.port(), config.asks_for_tokens() ? "#token=TOKEN" : "");
  const std::string scheme = config.tls_cert.empty() ? "http://" : "https://";
  const std::string host = visitor_host(config.bind, config.tls_cert, machine_addresses());
  const bool all = config.bind == "0.0.0.0" || config.bind == "::";
  log_info(
      {.event = "ready"}, "open {} in a browser{}; Ctrl-C stops the server", scheme + host + rest,
      all && host != "localhost" ? ", on this machine also " + scheme + "localhost" + rest : "");
  if (config.asks_for_tokens())
    log_info({.event = "access"}, "visitors need a TOKEN in that address: {}",
             config.token_key_file.empty()
                 ? fmt::format("a line of {}", config.token_file)
                 : fmt::format("catgs-server token --token-key-file {} makes one",
                               config.token_key_file));
}

void Server::State::wait_for_signal() {
  stop.signals.async_wait([this](const boost::system::error_code& error, int signal) {
    if (error) return;
    if (stop.begun) ::_exit(1);
    wait_for_signal();
    if (signal == SIGTERM)
      begin_stop(std::chrono::seconds(config.drain_wait_s),
                 std::chrono::seconds(config.drain_deadline_s));
    else
      begin_stop(0ms, quick_stop_deadline);  // somebody at a terminal waits for the prompt
  });
}

void Server::State::begin_stop(std::chrono::milliseconds wait, std::chrono::milliseconds deadline) {
  if (std::exchange(stop.begun, true)) return;
  ready = false;
  if (wait == 0ms) return drain(deadline);
  log_info({.event = "stopping"}, "stopping: not ready any more, clients are told in {} s",
           std::chrono::duration_cast<std::chrono::seconds>(wait).count());
  stop.timer.expires_after(wait);
  stop.timer.async_wait([this, deadline](const boost::system::error_code&) { drain(deadline); });
}

void Server::State::give_up(const std::string& why) {
  if (stop.begun) return;
  stop.failure = why;
  log_event(spdlog::level::critical, {.event = "failed"},
            "{}; the process ends, so that its supervisor restarts it", stop.failure);
  begin_stop(0ms, quick_stop_deadline);
}

void Server::State::drain(std::chrono::milliseconds deadline) {
  log_info({.event = "drain"}, "stopping: {} connections are told", places->connections());
  places->drain(deadline);
  authors.saver->stop();
  when_empty(Clock::now() + deadline, [this] {
    places->close_all();
    when_empty(Clock::now() + farewell_time, [this] { finish_stop(); });
  });
}

void Server::State::when_empty(TimePoint deadline, std::function<void()> then) {
  const bool empty = places->connections() == 0 && net.uploads() == 0;
  if (empty || Clock::now() >= deadline) return then();
  stop.timer.expires_after(drain_poll);
  stop.timer.async_wait([this, deadline, then = std::move(then)](const boost::system::error_code&) {
    when_empty(deadline, then);
  });
}

void Server::State::finish_stop() {
  net.stop();
  places->stop_timer();
  stop.signals.cancel();  // nothing is left to wait for but frames under way: io.run() returns
}

}  // namespace catgs
