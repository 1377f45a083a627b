#include "server/server.h"

#include <atomic>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <fmt/format.h>
#include <unistd.h>

#include "render_core/base/device_set.h"
#include "render_core/base/thread_pool.h"
#include "server/access/access.h"
#include "server/base/liveness.h"
#include "server/base/log.h"
#include "server/base/metrics.h"
#include "server/base/prompt_thread.h"
#include "server/base/watchdog.h"
#include "server/counts/usage_statistics.h"
#include "server/frame_path.h"
#include "server/graceful_stop.h"
#include "server/net/net_server.h"
#include "server/net/visitor_address.h"
#include "server/request_handlers.h"
#include "server/router.h"
#include "server/scenes/scene_library.h"
#include "server/schedule/pool_executor.h"
#include "server/schedule/watched_executor.h"
#include "server/visit/sessions.h"

namespace catgs {
namespace {

// Two or three frames at a time keep a GPU busy. More would only take turns.
constexpr int render_threads_per_gpu = 3;

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
  options.presets.threads = config.encoder_threads;
  options.policy.x264_aq = config.x264_aq;
  options.policy.forecasts = config.forecasts;
  options.policy.quality_ladder = config.quality_ladder;
  return options;
}

}  // namespace

struct Server::State {
  State(const ServerConfig& configuration, const ServerParts& parts)
      : config(configuration),
        liveness(parts.liveness_clock),
        access(config.token_file, config.token_key_file, config.open, config.revoked_links,
               read_own_key(config.resume_key_file, config.token_key_file)),
        client(find_client(config.client_dir)),
        net(net_options(), background),
        core{.kind = config.renderer,
             .pool = std::make_shared<ThreadPool>(config.threads),
             .devices = std::make_shared<DeviceSet>(config.devices)} {}

  NetOptions net_options();
  void print_banner() const;

  const ServerConfig config;
  Liveness liveness;
  AccessControl access;
  Metrics metrics;
  const StaticFiles client;
  std::atomic<bool> ready{false};
  Background background{all_lanes};
  NetServer net;
  boost::asio::io_context io{1};  // outlives the pool of the core, whose tasks post to it
  RendererOptions core;           // all scenes' Views are counted in one set of devices
  std::optional<VisitCounts> counts;
  std::optional<UsageStatistics> statistics;
  std::unique_ptr<SceneLibrary> scenes;
  std::vector<EncoderChoice> encoders;
  std::unique_ptr<FramePath> frames;
  std::unique_ptr<Sessions> sessions;
  std::optional<RequestHandlers> handlers;  // their threads use what is above
  std::optional<Router> router, admin_router;
  GracefulStop graceful_stop{io};
};

NetOptions Server::State::net_options() {
  NetOptions options;
  options.listen = {config.bind, config.port};
  options.http = [this](const HttpRequest& request) { return router->respond(request); };
  options.serves_delete = [this](std::string_view path) { return router->serves_delete(path); };
  options.uploads.most_bytes = [this](std::string_view path) { return router->most_bytes(path); };
  options.uploads.refusal = [this](const HttpRequest& request) {
    return router->refuse_upload(request);
  };
  options.uploads.take = [this](const HttpRequest& request, std::string body,
                                std::shared_ptr<const UploadSlot> slot) {
    return router->take_upload(request, std::move(body), std::move(slot));
  };
  options.uploads.on_full = [this] { metrics.uploads_refused.Increment(); };
  options.accept = [this](std::shared_ptr<Connection> connection) {
    return sessions->accept(std::move(connection));
  };
  options.on_refused = [this](const LogFacts& facts, const std::string& text) {
    metrics.requests_refused.Increment();
    log_refusal(facts, text);
  };
  options.on_failed = [this] {
    boost::asio::post(io, [this] { graceful_stop.give_up("the network thread failed"); });
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
    options.admin_http = [this](const HttpRequest& request) {
      return admin_router->respond(request);
    };
  }
  return options;
}

Server::Server(const ServerConfig& config, const ServerParts& parts)
    : state_(std::make_unique<State>(config, parts)) {
  State& s = *state_;
  if (s.config.visit_counts != "off") {
    s.counts.emplace(unix_now_s);
    s.statistics.emplace(s.config.visit_counts == "memory" ? "" : s.config.visit_counts, *s.counts,
                         s.background);
  }
  s.scenes = std::make_unique<SceneLibrary>(s.config, s.core, s.background, s.io, s.metrics);
  s.encoders = usable_encoders(s.config.encoder, probe_encoders());
  auto authorize = [&s](const std::string& token) {
    const auto resolve = [&s](auto name) { return s.scenes->resolve(name); };
    return s.access.permit(token, unix_now_s(), resolve);
  };
  VisitOptions options = visit_options(s.config);
  PoolExecutor::Pools pools{s.core.pool};
  for (const auto& [device, views] : s.core.devices->views())
    pools.render.emplace(device, std::make_shared<ThreadPool>(render_threads_per_gpu));
  options.cpus = cpus_for(s.core.pool, s.config.threads);
  options.on_tick = [&s] { s.liveness.session_moved(); };
  std::shared_ptr<FrameExecutor> executor = std::make_shared<PoolExecutor>(std::move(pools));
  if (parts.wrap) executor = parts.wrap(std::move(executor));
  executor = std::make_shared<WatchedExecutor>(std::move(executor), s.liveness);
  s.frames = std::make_unique<FramePath>(
      s.io, executor, static_cast<int>(s.core.devices->views().size()),
      [&s](const auto& why) { s.graceful_stop.give_up("no device renders any more: " + why); },
      s.metrics);
  s.sessions = std::make_unique<Sessions>(
      VisitContext{s.io, options, executor, *s.core.devices, *s.frames, *s.scenes, s.encoders,
                   authorize, SessionTokens(s.access.own_key()), s.metrics,
                   s.counts ? &*s.counts : nullptr, [&s] { return s.access.revoked_links(); }});
  s.handlers.emplace(RequestHandlers::Parts{
      s.io, s.background, s.config, *s.scenes, s.access, authorize, *s.sessions, *s.core.devices,
      s.liveness, s.ready, s.metrics, s.client, s.statistics ? &*s.statistics : nullptr});
  s.router.emplace(public_routes(), *s.handlers);
  s.admin_router.emplace(admin_routes(), *s.handlers);
}

Server::~Server() {
  // The network thread hands connections to the sessions, which are destroyed before the network.
  if (state_) state_->net.stop();
}

void Server::run() {
  State& s = *state_;
  s.graceful_stop.start({s.config, s.ready, *s.sessions, s.handlers->saver, s.net});
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
  const std::string& failure = s.graceful_stop.failure();
  if (!failure.empty()) throw std::runtime_error(failure);
}

void Server::stop() {
  boost::asio::post(state_->io, [this] { state_->graceful_stop.begin_quickly(); });
}

int Server::port() const { return state_->net.port(); }
int Server::admin_port() const { return state_->net.admin_port(); }

void Server::State::print_banner() const {
  log_info({.event = "encoder"}, "encoder: {}", encoders.front().text);
  if (net.admin_port() != 0)
    log_info({.event = "metrics"}, "metrics: http://{}/metrics",
             fmt::format("{}:{}", parse_endpoint(config.admin_bind).address, net.admin_port()));
  if (config.asks_for_tokens())
    log_info({.event = "access"}, "visitors need a TOKEN in the address: {}",
             config.token_key_file.empty()
                 ? fmt::format("a line of {}", config.token_file)
                 : fmt::format("catgs-server token --token-key-file {} makes one",
                               config.token_key_file));
  const std::string rest =
      fmt::format(":{}/{}", net.port(), config.asks_for_tokens() ? "#token=TOKEN" : "");
  const std::string scheme = config.tls_cert.empty() ? "http://" : "https://";
  const std::string host = visitor_host(config.bind, config.tls_cert, machine_addresses());
  const bool all = config.bind == "0.0.0.0" || config.bind == "::";
  log_info(
      {.event = "ready"}, "open {} in a browser{}; Ctrl-C stops the server", scheme + host + rest,
      all && host != "localhost" ? ", on this machine also " + scheme + "localhost" + rest : "");
}

}  // namespace catgs
