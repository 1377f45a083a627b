#include "server/net/net_server.h"

#include <atomic>
#include <csignal>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <libwebsockets.h>

#include "render_core/base/error.h"
#include "server/base/prompt_thread.h"
#include "server/base/required_file.h"
#include "server/net/accept_gate.h"
#include "server/net/certificate_watch.h"
#include "server/net/listen_error.h"
#include "server/net/lws_callbacks.h"
#include "server/net/lws_site.h"

namespace catgs {
namespace {

constexpr int request_timeout_s = 10;       // for a peer to send its request
constexpr std::uint16_t ping_after_s = 20;  // of silence; hung up ten seconds later
constexpr std::uint16_t hang_up_after_s = 30;

constexpr unsigned buffer_bytes = 64 * 1024;  // read or written per connection and round

// Headers of all answers, including those that libwebsockets makes itself.
const lws_protocol_vhost_options resource_policy = {nullptr, nullptr,
                                                    "cross-origin-resource-policy:", "same-origin"};
const lws_protocol_vhost_options referrer_policy = {&resource_policy, nullptr,
                                                    "referrer-policy:", "no-referrer"};
const lws_protocol_vhost_options content_type_options = {&referrer_policy, nullptr,
                                                         "x-content-type-options:", "nosniff"};
const lws_protocol_vhost_options vary = {&content_type_options, nullptr,
                                         "vary:", "accept-encoding"};
const lws_protocol_vhost_options common_headers = {&vary, nullptr, "connection:", "close"};

/// The server whose network thread this is; null: none.
thread_local const Site* served = nullptr;

std::string_view without_line_end(std::string_view line) {
  while (line.ends_with('\n')) line.remove_suffix(1);
  return line;
}

/// While it lives, libwebsockets' errors become an InputError.
void log_details(int, const char* line) {
  log_debug({.event = "libwebsockets"}, "libwebsockets: {}", without_line_end(line));
}

/// While it lives, libwebsockets' errors are reported here only. They are not errors of the server,
/// which the log would never omit: on the network thread most concern input from strangers. One
/// warning is about a request that it hangs up on.
void log_errors(int level, const char* line) {
  const bool hangs_up = level == LLL_ERR || std::string_view(line).starts_with("More hdr frags");
  if (!hangs_up) return log_details(level, line);
  const LogFacts facts{.event = "libwebsockets"};
  if (!served) return log_warning(facts, "libwebsockets: {}", without_line_end(line));
  guarded([&] {
    served->on_refused(facts, fmt::format("libwebsockets: {}", without_line_end(line)));
    return 0;
  });
}

constexpr int log_levels = LLL_ERR | LLL_WARN;

Names names_of(const Endpoint& endpoint, bool asks_for_tokens) {
  if (is_loopback(endpoint.address)) return Names::loopback;
  return asks_for_tokens ? Names::all : Names::local;
}

}  // namespace

struct NetServer::State {
  State(int sessions_of_an_address, Background& background)
      : service(AcceptGate::bounds_for(sessions_of_an_address), background) {}

  Site site;
  Site admin_site;
  Service service;
  lws_retry_bo_t idle_policy{};
  lws_context* context = nullptr;
  std::optional<CertificateWatch> certificates;
  int port = 0;
  int admin_port = 0;
  std::function<void()> on_failed;
  std::atomic<bool> stopping{false};
  std::thread thread;

  /// Returns the port that was really bound.
  int listen(const char* name, const Endpoint& endpoint, const char* flag, Site& on,
             const NetOptions* tls);
};

int NetServer::State::listen(const char* name, const Endpoint& endpoint, const char* flag, Site& on,
                             const NetOptions* tls) {
  const bool all = endpoint.address == "0.0.0.0" || endpoint.address == "::";
  lws_context_creation_info info{};
  info.vhost_name = name;
  info.port = endpoint.port;
  info.iface = all ? nullptr : endpoint.address.c_str();
  info.protocols = service_protocols;
  info.user = &on;
  info.timeout_secs = request_timeout_s;
  info.headers = &common_headers;
  info.retry_and_idle_policy = &idle_policy;
  info.options = LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND;
  if (endpoint.address.find(':') == std::string::npos)
    info.options |= LWS_SERVER_OPTION_DISABLE_IPV6;
  if (tls) {
    // Plain HTTP gets in, too, and is answered with the https address (lacks_tls).
    info.options |= LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT |
                    LWS_SERVER_OPTION_ALLOW_NON_SSL_ON_SSL_PORT |
                    LWS_SERVER_OPTION_ALLOW_HTTP_ON_HTTPS_LISTENER;
    info.ssl_cert_filepath = tls->tls_certificate.c_str();
    info.ssl_private_key_filepath = tls->tls_key.c_str();
    info.alpn = "http/1.1";
  }
  lws_set_log_level(log_levels, log_details);
  lws_vhost* made = lws_create_vhost(context, &info);
  lws_set_log_level(log_levels, log_errors);
  if (!made) throw_listen_error(endpoint, flag, tls);
  return lws_get_vhost_listen_port(made);
}

NetServer::NetServer(NetOptions options, Background& background)
    : state_(std::make_unique<State>(options.sessions_of_an_address, background)) {
  // A write to a closed peer is an error code, not a signal.
  std::signal(SIGPIPE, SIG_IGN);
  lws_set_log_level(log_levels, log_errors);
  const bool tls = !options.tls_certificate.empty();
  if (tls) {
    open_required_file("--tls-cert", options.tls_certificate);
    open_required_file("--tls-key", options.tls_key);
  }
  State& s = *state_;
  s.on_failed = std::move(options.on_failed);
  s.site = {std::move(options.http),
            std::move(options.uploads),
            std::move(options.serves_delete),
            std::move(options.accept),
            options.allowed_origins,
            content_security_policy(options.embed_origins, options.media_origins),
            names_of(options.listen, options.asks_for_tokens),
            tls,
            TrustedProxies(options.trusted_proxies),
            options.on_refused};
  s.admin_site = {std::move(options.admin_http),
                  {},
                  [](std::string_view) { return false; },
                  nullptr,
                  options.allowed_origins,
                  content_security_policy({}),
                  names_of(options.admin_listen, false),
                  false,
                  {},
                  options.on_refused};
  s.idle_policy.secs_since_valid_ping = ping_after_s;
  s.idle_policy.secs_since_valid_hangup = hang_up_after_s;

  AcceptGate::raise_descriptor_limit();
  lws_context_creation_info info{};
  info.options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS;
  if (tls) info.options |= LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT;
  info.user = &s.service;
  info.pt_serv_buf_size = buffer_bytes;
  info.max_http_header_data2 = kept_head_bytes;
  info.gid = static_cast<gid_t>(-1);
  info.uid = static_cast<uid_t>(-1);
  s.context = lws_create_context(&info);
  if (!s.context) throw InputError("libwebsockets", {}, "cannot create its context");
  try {
    s.port = s.listen("public", options.listen, "--bind", s.site, tls ? &options : nullptr);
    if (options.admin)
      s.admin_port = s.listen("admin", options.admin_listen, "--admin-bind", s.admin_site, nullptr);
  } catch (...) {
    lws_context_destroy(s.context);
    throw;
  }
  if (tls) s.certificates.emplace(s.context, options.tls_certificate, options.tls_key);
  s.service.waker->attach(s.context);
}

NetServer::~NetServer() { stop(); }

void NetServer::start() {
  AcceptGate::require_room();
  State& s = *state_;
  s.thread = std::thread([&s] {
    run_promptly();
    served = &s.site;
    while (!s.stopping.load()) {
      if (lws_service(s.context, 0) < 0) {
        s.on_failed();
        break;
      }
      accept_again(s.service);
      s.service.answered.serve(s.context);
      pause_where_nothing_happens(s.service);
    }
    s.service.waker->detach();
    s.certificates.reset();
    lws_context_destroy(s.context);  // calls the callbacks of what is still open
  });
}

void NetServer::stop() {
  State& s = *state_;
  if (s.thread.joinable()) {
    s.stopping.store(true);
    s.service.waker->wake();
    s.thread.join();
  } else if (s.context) {
    s.service.waker->detach();
    s.certificates.reset();
    lws_context_destroy(s.context);
  }
  s.context = nullptr;
  s.service.disk.end();  // answers may need what outlives this object no more
}

int NetServer::port() const { return state_->port; }

int NetServer::admin_port() const { return state_->admin_port; }

std::size_t NetServer::uploads() const {
  return state_->service.uploads.taken() + state_->service.large_uploads.taken();
}

}  // namespace catgs
