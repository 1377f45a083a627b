#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <libwebsockets.h>

#include "server/base/log_event.h"
#include "server/net/connection.h"
#include "server/net/http.h"
#include "server/net/trusted_proxies.h"

namespace catgs {

/// Holds the settings of one listening port. The vhost's user pointer points to it.
struct Site {
  HttpHandler http;
  HttpUploads uploads;
  std::function<bool(std::string_view path)> serves_delete;  // see NetOptions
  ConnectionAcceptor accept;                                 // null: no websockets
  std::vector<std::string> allowed_origins;
  std::string policy;
  Names names = Names::loopback;
  bool tls = false;
  TrustedProxies proxies;
  std::function<void(const LogFacts&, const std::string&)> on_refused;
};

const Site& site_of(lws* wsi);

/// The client's address, as seen through trusted proxies.
std::string client_address_of(lws* wsi);

/// The address by which the client reached this server.
std::string site_address(lws* wsi, const std::string& host);

/// True if the request is for one of Site::names. TLS requests are, except on loopback: a page that
/// resolves its own name to this server has no certificate for it.
bool host_allowed(lws* wsi, const std::string& host);

/// True for a plain HTTP request to a port that serves https.
bool lacks_tls(lws* wsi);

/// Reports to Site::on_refused whose request is refused, and why. `status`: of the answer; 0: none.
void note_refused(lws* wsi, unsigned status, std::string_view why);

/// Reports a refused upload or websocket from another site's page.
void note_refused_origin(lws* wsi, std::string_view what, const std::string& origin,
                         const std::string& host);

/// Answers a request without asking a handler. Nonzero: the connection closes.
int refuse_request(lws* wsi, unsigned status, const char* why);

/// The headers that libwebsockets knows by name may take so much. It keeps half as much again, for
/// others and so that somewhat larger heads get an answer. What is still larger is hung up on.
inline constexpr std::size_t max_head_bytes = 16 * 1024;
inline constexpr unsigned kept_head_bytes = max_head_bytes * 3 / 2;

/// Refuses a request with a faulty head; nothing: it has none. libwebsockets decodes a path before
/// it looks for the end of its line. By a %0a in the path, a page could therefore replace the
/// version by a header of its own or hide its Host.
std::optional<int> refuse_faulty_head(lws* wsi);

/// The callback's result for a request with an Upgrade header. h2c is refused: its parser lacks our
/// time limits. libwebsockets would refuse a wrong Connection header of a websocket without an
/// answer.
int confirm_upgrade(lws* wsi);

HttpResponse refuse_host(lws* wsi, const std::string& host);

/// Returns the answer of Site::http if the host is allowed and, for DELETE, the origin.
HttpResponse respond(lws* wsi, const std::string& host, const HttpRequest& request);

/// Returns the refusal of an upload; nothing: its body may come.
std::optional<HttpResponse> refuse_upload(lws* wsi);

}  // namespace catgs
