#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <libwebsockets.h>

#include "server/net/connection.h"
#include "server/net/http.h"
#include "server/net/trusted_proxies.h"

namespace catgs {

/// What one listening port serves; the vhost's user pointer.
struct Site {
  HttpHandler http;
  HttpUploads uploads;
  ConnectionAcceptor accept;  // null: no websockets
  std::vector<std::string> allowed_origins;
  std::string policy;
  Names names = Names::loopback;
  TrustedProxies proxies;
  std::function<void(const std::string&)> on_refused;
};

const Site& site_of(lws* wsi);

/// Who is behind the proxies that are trusted.
std::string client_address_of(lws* wsi);

/// How the client came here.
std::string site_address(lws* wsi, const std::string& host);

/// Is the request for one of Site::names? By TLS it is, but on a loopback address: a page that let
/// its own name resolve to this server has no certificate for it.
bool host_allowed(lws* wsi, const std::string& host);

/// Tells Site::on_refused whose request is refused, and why.
void note_refused(lws* wsi, std::string_view why);

/// The same, of an upload or a websocket from another site's page.
void note_refused_origin(lws* wsi, std::string_view what, const std::string& origin,
                         const std::string& host);

/// Answers a request that no handler is asked about. Nonzero: the connection closes.
int refuse_request(lws* wsi, unsigned status, const char* why);

/// What is wrong with a head; null: nothing. libwebsockets decodes a path before it looks for the
/// end of its line: by a %0a in it a page writes a header of its own in place of the version, or
/// hides its Host.
const char* fault_of_head(lws* wsi);

/// Of a request with an Upgrade header, the callback's result. h2c is another parser, without our
/// time limits; a websocket's Connection header libwebsockets would refuse without an answer.
int confirm_upgrade(lws* wsi);

HttpResponse refuse_host(lws* wsi, const std::string& host);

/// Site::http's answer, if the host is allowed.
HttpResponse respond(lws* wsi, const std::string& host, const HttpRequest& request);

/// Why nothing is taken from this upload; nothing: its body may come.
std::optional<HttpResponse> refuse_upload(lws* wsi);

}  // namespace catgs
