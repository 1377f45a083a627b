#include "server/net/net_server.h"

#include <array>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <libwebsockets.h>
#include <spdlog/spdlog.h>

#include "render_core/base/error.h"
#include "server/net/accept_gate.h"
#include "server/net/certificate_watch.h"
#include "server/net/listen_error.h"
#include "server/net/lws_http.h"
#include "server/net/lws_site.h"
#include "server/net/lws_websocket.h"
#include "server/net/wire.h"
#include "server/prompt_thread.h"
#include "server/required_file.h"

namespace catgs {
namespace {

constexpr int request_timeout_s = 10;       // a peer that is slow to send its request
constexpr std::uint16_t ping_after_s = 20;  // of silence; hung up ten seconds later
constexpr std::uint16_t hang_up_after_s = 30;

/// Per-connection memory that libwebsockets owns, zeroed at its birth.
struct HttpSlot {
  LwsHttpExchange* exchange;
};
struct WebsocketSlot {
  std::shared_ptr<LwsWebsocket>* connection;
};

/// The context's user pointer: what callbacks need besides their site.
struct Service {
  std::shared_ptr<LwsWaker> waker = std::make_shared<LwsWaker>();
  std::vector<std::byte> scratch;  // outgoing bytes of the packet being written
  AcceptGate gate;
};

Service& service_of(lws* wsi) {
  return *static_cast<Service*>(lws_context_user(lws_get_context(wsi)));
}

void forget(HttpSlot& slot) { delete std::exchange(slot.exchange, nullptr); }

bool is_get_or_head(lws* wsi) {
  return lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) > 0 ||
         lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
}

const std::string upload_length_rule =
    fmt::format("a Content-Length of 1 to {} is needed", max_upload_bytes);

// Results of callbacks.
constexpr int keep_reading = 0;
constexpr int close_connection = -1;

/// A connection answers one request, and every answer says so. libwebsockets does not show a head
/// as it came: a line that a proxy reads as a length is none to it, and what follows may be a body.
int on_request(lws* wsi, HttpSlot& slot) {
  const Site& site = site_of(wsi);
  if (const char* fault = fault_of_head(wsi)) return refuse_request(wsi, 400, fault);
  // libwebsockets knows no chunks and would take them for the next request.
  if (lws_hdr_total_length(wsi, WSI_TOKEN_HTTP_TRANSFER_ENCODING) > 0)
    return refuse_request(wsi, 411, "Content-Length is needed, not Transfer-Encoding");
  if (site.uploads.take && lws_hdr_total_length(wsi, WSI_TOKEN_PUT_URI) > 0) {
    slot.exchange = new LwsHttpExchange;
    const std::uint64_t bytes = body_length(wsi).value_or(0);
    if (bytes >= 1 && bytes <= max_upload_bytes)
      return slot.exchange->begin_upload(wsi, refuse_upload(wsi));
    const int status = bytes < 1 ? 411 : 413;
    const std::string why = fmt::format("{}: {}", status, upload_length_rule);
    note_refused(wsi, "upload refused: " + why);
    if (slot.exchange->refuse_body(wsi, text_response(status, why + "\n"),
                                   service_of(wsi).scratch) != 0)
      return close_connection;
    const bool body_follows = request_header(wsi, WSI_TOKEN_HTTP_CONTENT_LENGTH) != "0";
    return body_follows ? keep_reading : close_connection;
  }
  if (!is_get_or_head(wsi)) return refuse_request(wsi, 405, "only GET and HEAD are served here");
  // It means nothing, and libwebsockets would report it while the answer is on its way.
  if (const auto bytes = body_length(wsi); bytes != 0)
    return refuse_request(wsi, bytes ? 413 : 400, "a GET needs no body");
  slot.exchange = new LwsHttpExchange;
  const std::string host = request_header(wsi, WSI_TOKEN_HOST);
  const HttpHandler handler = [&](const HttpRequest& request) {
    return respond(wsi, host, request);
  };
  return slot.exchange->begin(wsi, handler, site_address(wsi, host));
}

/// Before there is a lws of it. Operators and probes come in even where nobody else does; a proxy
/// has one address for all its clients.
int on_accept(lws* listener, int descriptor) {
  const Site& site = site_of(listener);
  if (!site.accept) return keep_reading;
  std::array<char, 64> peer{};
  lws_get_peer_simple_fd(descriptor, peer.data(), peer.size());
  const std::string counted = site.proxies.is_proxy(peer.data()) ? "" : limited_as(peer.data());
  const auto why =
      service_of(listener).gate.refusal(descriptor, AcceptGate::descriptor_limit(), counted);
  if (!why) return keep_reading;
  site.on_refused(fmt::format("{}: {}", peer.data(), *why));
  return close_connection;
}

int on_http(lws* wsi, lws_callback_reasons reason, HttpSlot* slot, void* in, std::size_t length) {
  switch (reason) {
    case LWS_CALLBACK_FILTER_NETWORK_CONNECTION:
      return on_accept(wsi, static_cast<int>(reinterpret_cast<std::intptr_t>(in)));
    case LWS_CALLBACK_WSI_CREATE:
      service_of(wsi).gate.opened(wsi);
      return 0;
    case LWS_CALLBACK_WSI_DESTROY:
      service_of(wsi).gate.closed(wsi);
      return 0;
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
      return confirm_upgrade(wsi);
    case LWS_CALLBACK_RAW_ADOPT:  // what libwebsockets makes of a CONNECT
      note_refused(wsi, "request refused: this is no proxy");
      return close_connection;
    case LWS_CALLBACK_HTTP:
      return on_request(wsi, *slot);
    case LWS_CALLBACK_HTTP_BODY:
      if (!slot || !slot->exchange) return 0;
      return slot->exchange->take_body({static_cast<const char*>(in), length});
    case LWS_CALLBACK_HTTP_BODY_COMPLETION:
      if (!slot || !slot->exchange) return 0;
      return slot->exchange->end_body(wsi, site_of(wsi).uploads);
    case LWS_CALLBACK_TIMER:
      if (!slot || !slot->exchange) return 0;
      return slot->exchange->on_timer(wsi);
    case LWS_CALLBACK_HTTP_WRITEABLE:
      if (!slot || !slot->exchange) return 0;
      return slot->exchange->on_writable(wsi, service_of(wsi).scratch);
    case LWS_CALLBACK_HTTP_DROP_PROTOCOL:
    case LWS_CALLBACK_CLOSED_HTTP:
      if (slot) forget(*slot);
      return 0;
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:  // a websocket that did not ask for catgs.v1
      return refuse_request(wsi, 400, "ask for subprotocol catgs.v1");
    case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
      for (const auto& connection : service_of(wsi).waker->take()) connection->service_woken();
      return 0;
    default:
      return lws_callback_http_dummy(wsi, reason, slot, in, length);
  }
}

int on_websocket(lws* wsi, lws_callback_reasons reason, WebsocketSlot* slot,
                 std::span<const std::byte> bytes) {
  switch (reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION: {
      const Site& site = site_of(wsi);
      if (const char* fault = fault_of_head(wsi)) return refuse_request(wsi, 400, fault);
      // libwebsockets takes any version of the protocol, and any method.
      if (lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) <= 0 ||
          request_header(wsi, WSI_TOKEN_VERSION) != "13")
        return refuse_request(wsi, 400, "open websockets by GET, Sec-WebSocket-Version 13");
      const std::string origin = request_header(wsi, WSI_TOKEN_ORIGIN);
      const std::string host = request_header(wsi, WSI_TOKEN_HOST);
      if (site.accept && host_allowed(wsi, host) &&
          origin_allowed(origin, host, site.allowed_origins))
        return 0;
      note_refused_origin(wsi, "websocket", origin, host);
      lws_return_http_status(wsi, 403, "this origin is not allowed");
      return -1;
    }
    case LWS_CALLBACK_ESTABLISHED: {
      auto connection =
          std::make_shared<LwsWebsocket>(wsi, service_of(wsi).waker, client_address_of(wsi));
      slot->connection = new std::shared_ptr<LwsWebsocket>(connection);
      connection->service_listen(site_of(wsi).accept(connection));
      return 0;
    }
    case LWS_CALLBACK_RECEIVE:
      return (*slot->connection)->service_receive(bytes);
    case LWS_CALLBACK_TIMER:
      return (*slot->connection)->service_timer();
    case LWS_CALLBACK_SERVER_WRITEABLE:
      return (*slot->connection)->service_writeable(service_of(wsi).scratch);
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE:
      (*slot->connection)->service_peer_closes(bytes);
      return 0;
    case LWS_CALLBACK_CLOSED:
      if (slot && slot->connection) {
        (*slot->connection)->service_closed();
        delete std::exchange(slot->connection, nullptr);
      }
      return 0;
    default:
      return 0;
  }
}

/// No exception may pass through C: it costs its own connection only.
template <typename Function>
int guarded(Function&& function) {
  try {
    return function();
  } catch (const std::exception& error) {
    spdlog::error("network: {}", error.what());
    return -1;
  }
}

int http_callback(lws* wsi, lws_callback_reasons reason, void* user, void* in, std::size_t length) {
  return guarded([&] { return on_http(wsi, reason, static_cast<HttpSlot*>(user), in, length); });
}

int websocket_callback(lws* wsi, lws_callback_reasons reason, void* user, void* in,
                       std::size_t length) {
  return guarded([&] {
    return on_websocket(wsi, reason, static_cast<WebsocketSlot*>(user),
                        {static_cast<const std::byte*>(in), length});
  });
}

// A socket buffer of one whole message at most: larger ones arrive in pieces and are refused.
const lws_protocols protocols[] = {
    {"http", http_callback, sizeof(HttpSlot), 0, 0, nullptr, 0},
    {"catgs.v1", websocket_callback, sizeof(WebsocketSlot), wire::max_client_message_bytes, 0,
     nullptr, 0},
    {nullptr, nullptr, 0, 0, 0, nullptr, 0},
};

// Of all answers, those that libwebsockets makes by itself too.
const lws_protocol_vhost_options resource_policy = {nullptr, nullptr,
                                                    "cross-origin-resource-policy:", "same-origin"};
const lws_protocol_vhost_options referrer_policy = {&resource_policy, nullptr,
                                                    "referrer-policy:", "no-referrer"};
const lws_protocol_vhost_options content_type_options = {&referrer_policy, nullptr,
                                                         "x-content-type-options:", "nosniff"};
const lws_protocol_vhost_options vary = {&content_type_options, nullptr,
                                         "vary:", "accept-encoding"};
const lws_protocol_vhost_options common_headers = {&vary, nullptr, "connection:", "close"};

/// Whose network thread this is; null: nobody's.
thread_local const Site* served = nullptr;

std::string_view without_line_end(std::string_view line) {
  while (line.ends_with('\n')) line.remove_suffix(1);
  return line;
}

/// While they become an InputError.
void log_details(int, const char* line) {
  spdlog::debug("libwebsockets: {}", without_line_end(line));
}

/// While its errors are reported by nobody else. They are no errors of the server, which the log
/// would never leave out: on the network thread most are about what a stranger sent. One warning is
/// about a request that it hangs up on.
void log_errors(int level, const char* line) {
  const bool hangs_up = level == LLL_ERR || std::string_view(line).starts_with("More hdr frags");
  if (!hangs_up) return log_details(level, line);
  if (!served) return spdlog::warn("libwebsockets: {}", without_line_end(line));
  guarded([&] {
    served->on_refused(fmt::format("libwebsockets: {}", without_line_end(line)));
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
  info.protocols = protocols;
  info.user = &on;
  info.timeout_secs = request_timeout_s;
  info.headers = &common_headers;
  info.retry_and_idle_policy = &idle_policy;
  info.options = LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND;
  if (endpoint.address.find(':') == std::string::npos)
    info.options |= LWS_SERVER_OPTION_DISABLE_IPV6;
  if (tls) {
    info.options |= LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT;
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

NetServer::NetServer(NetOptions options) : state_(std::make_unique<State>()) {
  // A peer that goes away while it is written to is an error code, not a signal.
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
            std::move(options.accept),
            options.allowed_origins,
            content_security_policy(options.embed_origins),
            names_of(options.listen, options.asks_for_tokens),
            TrustedProxies(options.trusted_proxies),
            options.on_refused};
  s.admin_site = {std::move(options.admin_http),
                  {},
                  nullptr,
                  options.allowed_origins,
                  content_security_policy({}),
                  names_of(options.admin_listen, false),
                  {},
                  options.on_refused};
  s.idle_policy.secs_since_valid_ping = ping_after_s;
  s.idle_policy.secs_since_valid_hangup = hang_up_after_s;

  AcceptGate::raise_descriptor_limit();
  lws_context_creation_info info{};
  info.options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS;
  if (tls) info.options |= LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT;
  info.user = &s.service;
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
      if (lws_service(s.context, 0) >= 0) continue;
      s.on_failed();
      break;
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
}

int NetServer::port() const { return state_->port; }

int NetServer::admin_port() const { return state_->admin_port; }

}  // namespace catgs
