#include "server/server.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "server/access.h"
#include "server/link_preview.h"
#include "server/liveness.h"
#include "server/log.h"
#include "server/metrics.h"
#include "server/net/net_server.h"
#include "server/net/static_files.h"
#include "server/prompt_thread.h"
#include "server/scene_catalog.h"
#include "server/scene_library.h"
#include "server/schedule/pool_executor.h"
#include "server/schedule/watched_executor.h"
#include "server/session/session_registry.h"
#include "server/sidecar_saver.h"
#include "server/signed_token.h"
#include "server/stop_while_loading.h"
#include "server/watchdog.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto quick_stop_deadline = 1000ms;
constexpr auto farewell_time = 500ms;  // for close frames, after the deadline
constexpr auto drain_poll = 20ms;
// Two or three frames at a time keep a GPU busy; more only take turns on it.
constexpr int render_threads_per_gpu = 3;

constexpr std::string_view no_client_page =
    "CaT-GS server: the browser client was not built with this server.\n"
    "Configure with -DCATGS_WEB=ON, or give --client-dir.\n";

/// The built client of an installation (prefix/bin) or of a build tree (build/bin).
StaticFiles find_client(const std::string& client_dir) {
  namespace fs = std::filesystem;
  if (!client_dir.empty()) return StaticFiles(client_dir);
  std::error_code error;
  const fs::path bin = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const char* folder : {"../share/catgs/web", "../web_client/dist"})
    if (fs::exists(bin / folder / "index.html", error)) return StaticFiles(bin / folder);
  return {};
}

RegistryOptions registry_options(const ServerConfig& config) {
  RegistryOptions options;
  options.policy.idle_timeout = std::chrono::seconds(config.idle_timeout_s);
  options.policy.default_fps = config.fps;
  options.policy.default_bitrate_kbps = config.bitrate_kbps;
  options.max_sessions = config.max_sessions;
  options.max_sessions_per_address = config.max_sessions_per_address;
  options.max_queue = config.max_queue;
  options.max_spectators = config.max_spectators;
  options.min_fps = config.min_fps;
  options.encoders = {config.nvenc_sessions, config.nvenc_full == "queue"};
  for (int i = 0; i < static_cast<int>(std::size(effort_presets)); ++i)
    if (effort_presets[static_cast<std::size_t>(i)].name == config.x264_preset)
      options.presets = {i, i};
  return options;
}

SessionTokens session_tokens(const ServerConfig& config) {
  if (!config.resume_key_file.empty())
    return SessionTokens(read_key_file("--resume-key-file", config.resume_key_file));
  if (!config.token_key_file.empty())
    return SessionTokens(read_key_file("--token-key-file", config.token_key_file));
  return SessionTokens(random_key());
}

constexpr std::string_view sidecar_part = "/sidecar";

/// What there is to read of a scene, and where: "/api/scenes/ID<name>".
enum class ScenePart { tours, poster };
constexpr std::array<std::string_view, 2> part_names = {"/tours", "/poster.jpg"};

/// The token of "Authorization: Bearer TOKEN"; empty: none.
std::string_view bearer_token(std::string_view authorization) {
  constexpr std::string_view scheme = "Bearer ";
  return authorization.starts_with(scheme) ? authorization.substr(scheme.size()) : "";
}

HttpResponse json_response(std::shared_ptr<const std::string> body) {
  HttpResponse response;
  response.content_type = "application/json";
  response.body = std::move(body);
  return response;
}

/// Of "GET /api/scenes".
std::shared_ptr<const std::string> scene_list(
    const std::vector<const SceneLibrary::Listing*>& scenes) {
  auto list = nlohmann::json::array();
  for (const auto* scene : scenes)
    list.push_back({{"id", scene->id},
                    {"title", scene->title},
                    {"gaussians", scene->gaussians},
                    {"loaded", scene->loaded}});
  return std::make_shared<const std::string>(nlohmann::json{{"scenes", list}}.dump());
}

HttpResponse unauthorized(std::string_view why) {
  return text_response(401, fmt::format("401: {}\nSend it as Authorization: Bearer TOKEN\n", why));
}

}  // namespace

struct Server::State {
  State(const ServerConfig& configuration, const ServerParts& parts)
      : config(configuration),
        liveness(parts.liveness_clock),
        access(config.token_file, config.token_key_file),
        client(find_client(config.client_dir)),
        net(net_options()),
        pool(std::make_shared<ThreadPool>(config.threads)),
        devices(std::make_shared<DeviceSet>(config.devices)),
        stop_signals(io),
        drain_timer(io) {}

  NetOptions net_options();
  /// /healthz and /readyz, on both ports: probes of the admin port need neither TLS nor a host
  /// name.
  [[nodiscard]] std::optional<HttpResponse> respond_to_probe(const HttpRequest& request) const;
  HttpResponse respond(const HttpRequest& request);
  std::string preview(const HttpRequest& request);
  /// What the request's token admits to.
  Permit permit_of(const HttpRequest& request) {
    return access.permit(bearer_token(request.authorization), unix_now_s());
  }
  HttpResponse list_scenes(const Permit& permit);
  HttpResponse part_of_scene(std::string_view scene_id, ScenePart part, const Permit& permit);
  /// Of "PUT /api/scenes/ID/sidecar".
  std::optional<HttpResponse> refuse_upload(const HttpRequest& request);
  HttpResponse respond_admin(const HttpRequest& request);
  void print_banner() const;
  void wait_for_signal();
  /// Readiness ends; after `wait` clients are told, and after `deadline` more they are closed.
  void begin_stop(std::chrono::milliseconds wait, std::chrono::milliseconds deadline);
  /// Nobody can be served here any more: clients are told, and run() throws.
  void give_up(const std::string& why);
  void drain(std::chrono::milliseconds deadline);
  /// Goes on with `then` when nobody is connected any more, and at the latest at `deadline`.
  void when_empty(TimePoint deadline, std::function<void()> then);
  void finish_stop();

  const ServerConfig config;
  std::optional<StopWhileLoading> stop_while_loading{std::in_place};
  Liveness liveness;
  AccessControl access;
  Metrics metrics;
  const StaticFiles client;
  std::atomic<bool> ready{false};
  NetServer net;
  boost::asio::io_context io{1};  // outlives the pool, whose tasks post to it
  std::shared_ptr<ThreadPool> pool;
  std::shared_ptr<DeviceSet> devices;  // all scenes' Views are counted in one
  std::unique_ptr<SceneLibrary> scenes;
  std::unique_ptr<SidecarSaver> saver;
  // The answer to who may see every scene of a listing. Network thread.
  std::weak_ptr<const std::vector<SceneLibrary::Listing>> listed;
  std::shared_ptr<const std::string> whole_list;
  std::vector<EncoderChoice> encoders;
  boost::asio::signal_set stop_signals;
  boost::asio::steady_timer drain_timer;
  std::unique_ptr<SessionRegistry> registry;
  bool stopping = false;
  std::string failure;  // for which run() ends; empty: as it was asked to
};

NetOptions Server::State::net_options() {
  NetOptions options;
  options.listen = {config.bind, config.port};
  options.http = [this](const HttpRequest& request) { return respond(request); };
  options.uploads.refusal = [this](const HttpRequest& request) { return refuse_upload(request); };
  options.uploads.take = [this](const HttpRequest& request, std::string body) {
    return saver->save(std::string(scene_of(request.path, sidecar_part).value()), std::move(body),
                       {std::string(request.if_match), std::string(request.if_none_match)});
  };
  options.accept = [this](std::shared_ptr<Connection> connection) {
    return registry->accept(std::move(connection));
  };
  options.on_refused = [this](const std::string& line) {
    metrics.requests_refused.Increment();
    log_refusal(line);
  };
  options.on_failed = [this] {
    boost::asio::post(io, [this] { give_up("the network thread failed"); });
  };
  options.asks_for_tokens = config.asks_for_tokens();
  options.allowed_origins = config.allow_origins;
  options.embed_origins = config.embed_origins;
  options.trusted_proxies = config.trusted_proxies;
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
  if (request.path == "/api/scenes") return list_scenes(permit_of(request));
  for (const ScenePart part : {ScenePart::tours, ScenePart::poster})
    if (const auto id = scene_of(request.path, part_names[static_cast<std::size_t>(part)]))
      return part_of_scene(*id, part, permit_of(request));
  if (client.empty() && request.path == "/") return text_response(200, std::string(no_client_page));
  if (!client.empty() && (request.path == "/" || request.path == "/index.html"))
    return client.respond_with_head(request, preview(request));
  return client.respond(request);
}

/// For who sees the scene without a token: programs that make previews have none, and a preview
/// must not tell more than the page.
std::string Server::State::preview(const HttpRequest& request) {
  constexpr std::string_view name = "scene=";
  const auto argument = std::ranges::find_if(
      request.arguments, [&](const std::string& text) { return text.starts_with(name); });
  const auto listing = scenes->listing();
  const auto scene =
      argument == request.arguments.end()
          ? listing->begin()
          : std::ranges::find(*listing, std::string_view(*argument).substr(name.size()),
                              &SceneLibrary::Listing::id);
  if (scene == listing->end() || access.permit("", unix_now_s())(scene->id, Use::own_session))
    return {};
  return preview_elements(
      {request.site, scene->id, scene->title, scene->gaussians, scene->poster != nullptr});
}

/// What the permit shows. Like hello, this never tells a stranger what is here.
HttpResponse Server::State::list_scenes(const Permit& permit) {
  const auto listing = scenes->listing();
  std::vector<const SceneLibrary::Listing*> shown;
  Refusal refusal = listing->empty() ? permit({}, Use::list) : std::nullopt;
  for (const auto& scene : *listing) {
    if (auto refused = permit(scene.id, Use::list))
      refusal = std::move(refused);
    else
      shown.push_back(&scene);
  }
  if (shown.empty() && refusal) return unauthorized(*refusal);
  if (shown.size() < listing->size()) return json_response(scene_list(shown));
  if (listed.lock() != listing) {
    listed = listing;
    whole_list = scene_list(shown);
  }
  return json_response(whole_list);
}

HttpResponse Server::State::part_of_scene(std::string_view scene_id, ScenePart part,
                                          const Permit& permit) {
  if (const auto refused = permit(scene_id, Use::list)) return unauthorized(*refused);
  const auto listing = scenes->listing();
  const auto found = std::ranges::find(*listing, scene_id, &SceneLibrary::Listing::id);
  if (found == listing->end()) return text_response(404, "404: there is no such scene here\n");
  if (part == ScenePart::tours) {
    static const ToursAnswers none;
    const ToursAnswers& tours = found->tours ? *found->tours : none;
    return json_response(permit(scene_id, Use::save) ? tours.for_viewers : tours.for_authors);
  }
  if (!found->poster)
    return text_response(404, "404: the scene has no poster, or waits for its first visit\n");
  HttpResponse response;
  response.content_type = "image/jpeg";
  response.cache_control = "private, max-age=60";
  response.body = found->poster;
  return response;
}

std::optional<HttpResponse> Server::State::refuse_upload(const HttpRequest& request) {
  const auto scene_id = scene_of(request.path, sidecar_part);
  if (!scene_id) return text_response(405, "405: only the sidecars of scenes are saved here\n");
  const Permit permit = permit_of(request);
  if (const auto refused = permit(*scene_id, Use::list)) return unauthorized(*refused);
  if (const auto refused = permit(*scene_id, Use::save))
    return text_response(403, "403: " + *refused + "\n");
  if (std::ranges::count(*scenes->listing(), *scene_id, &SceneLibrary::Listing::id) == 0)
    return text_response(404, "404: there is no such scene here\n");
  return std::nullopt;
}

HttpResponse Server::State::respond_admin(const HttpRequest& request) {
  if (auto answer = respond_to_probe(request)) return *std::move(answer);
  for (const auto& [device, views] : devices->views()) metrics.set_views(device, views);
  for (const Liveness::Loop& loop : liveness.loops())
    metrics.set_loop_stalled(std::string(loop.name), loop.stalled);
  if (request.path == "/metrics")
    return text_response(200, metrics.scrape(), "text/plain; version=0.0.4; charset=utf-8");
  if (request.path == "/api/sessions")
    return text_response(200, registry->published_json(), "application/json");
  return text_response(404, "404: /metrics and /api/sessions are here\n");
}

Server::Server(const ServerConfig& config, const ServerParts& parts)
    : state_(std::make_unique<State>(config, parts)) {
  State& s = *state_;
  s.scenes = std::make_unique<SceneLibrary>(
      s.config, RendererOptions{.kind = s.config.renderer, .pool = s.pool, .devices = s.devices},
      s.io, s.metrics);
  s.saver = std::make_unique<SidecarSaver>(*s.scenes, s.io);
  s.encoders = usable_encoders(s.config.encoder, probe_encoders());
  auto authorize = [&s](const std::string& token) { return s.access.permit(token, unix_now_s()); };
  RegistryOptions options = registry_options(s.config);
  PoolExecutor::Pools pools{s.pool};
  for (const auto& [device, views] : s.devices->views())
    pools.render.emplace(device, std::make_shared<ThreadPool>(render_threads_per_gpu));
  if (!pools.render.empty()) options.devices = s.devices;
  options.cpus = s.pool->threads();
  options.on_devices_lost = [&s](const std::string& why) {
    s.give_up("no device renders any more: " + why);
  };
  options.on_tick = [&s] { s.liveness.session_moved(); };
  std::shared_ptr<FrameExecutor> executor = std::make_shared<PoolExecutor>(std::move(pools));
  if (parts.wrap) executor = parts.wrap(std::move(executor));
  executor = std::make_shared<WatchedExecutor>(std::move(executor), s.liveness);
  s.registry = std::make_unique<SessionRegistry>(s.io, std::move(options), std::move(executor),
                                                 *s.scenes, s.encoders, std::move(authorize),
                                                 session_tokens(s.config), s.metrics);
}

Server::~Server() {
  // The network thread hands connections to the registry, which ends before the network does.
  if (state_) state_->net.stop();
}

void Server::run() {
  State& s = *state_;
  s.stop_signals.add(SIGINT);
  s.stop_signals.add(SIGTERM);
  s.stop_while_loading.reset();
  s.wait_for_signal();
  s.net.start();
  run_promptly();  // others have been started
  s.ready = true;
  s.print_banner();
  const Watchdog watchdog(s.liveness, [](const std::string& why) {
    spdlog::critical("{}; the process ends, for its supervisor to start it anew", why);
    ::_exit(1);
  });
  s.io.run();
  spdlog::info("stopped");
  if (!s.failure.empty()) throw std::runtime_error(s.failure);
}

void Server::stop() {
  boost::asio::post(state_->io, [this] { state_->begin_stop(0ms, quick_stop_deadline); });
}

int Server::port() const { return state_->net.port(); }
int Server::admin_port() const { return state_->net.admin_port(); }

void Server::State::print_banner() const {
  const std::string host = config.bind == "0.0.0.0" || config.bind == "::" ? "localhost"
                           : config.bind.find(':') != std::string::npos    ? "[" + config.bind + "]"
                                                                           : config.bind;
  spdlog::info("renderer: {}", scenes->renderer_text());
  spdlog::info("encoder: {}", encoders.front().text);
  if (net.admin_port() != 0)
    spdlog::info("metrics: http://{}/metrics",
                 fmt::format("{}:{}", parse_endpoint(config.admin_bind).address, net.admin_port()));
  spdlog::info("open {}://{}:{}/ in a browser; Ctrl-C stops the server",
               config.tls_cert.empty() ? "http" : "https", host, net.port());
}

void Server::State::wait_for_signal() {
  stop_signals.async_wait([this](const boost::system::error_code& error, int signal) {
    if (error) return;
    if (stopping) ::_exit(1);
    wait_for_signal();
    if (signal == SIGTERM)
      begin_stop(std::chrono::seconds(config.drain_wait_s),
                 std::chrono::seconds(config.drain_deadline_s));
    else
      begin_stop(0ms, quick_stop_deadline);  // somebody at a terminal waits for the prompt
  });
}

void Server::State::begin_stop(std::chrono::milliseconds wait, std::chrono::milliseconds deadline) {
  if (std::exchange(stopping, true)) return;
  ready = false;
  if (wait == 0ms) return drain(deadline);
  spdlog::info("stopping: not ready any more, clients are told in {} s",
               std::chrono::duration_cast<std::chrono::seconds>(wait).count());
  drain_timer.expires_after(wait);
  drain_timer.async_wait([this, deadline](const boost::system::error_code&) { drain(deadline); });
}

void Server::State::give_up(const std::string& why) {
  if (stopping) return;
  failure = why;
  spdlog::critical("{}; the process ends, for its supervisor to start it anew", failure);
  begin_stop(0ms, quick_stop_deadline);
}

void Server::State::drain(std::chrono::milliseconds deadline) {
  spdlog::info("stopping: {} connections are told", registry->connections());
  registry->drain(deadline);
  when_empty(Clock::now() + deadline, [this] {
    registry->close_all();
    when_empty(Clock::now() + farewell_time, [this] { finish_stop(); });
  });
}

void Server::State::when_empty(TimePoint deadline, std::function<void()> then) {
  if (registry->connections() == 0 || Clock::now() >= deadline) return then();
  drain_timer.expires_after(drain_poll);
  drain_timer.async_wait([this, deadline, then = std::move(then)](
                             const boost::system::error_code&) { when_empty(deadline, then); });
}

void Server::State::finish_stop() {
  net.stop();
  registry->stop_timers();
  stop_signals.cancel();  // nothing is left to wait for but frames under way: io.run() returns
}

}  // namespace catgs
