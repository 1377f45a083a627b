#include "server/net/lws_site.h"

#include <algorithm>
#include <array>

#include <boost/beast/http/rfc7230.hpp>
#include <fmt/format.h>
#include <strings.h>

#include "render_core/base/printable.h"
#include "server/net/lws_http.h"

namespace catgs {
namespace {

/// Shortens a stranger's text to fit a line of the log or an answer.
constexpr std::size_t max_quoted_bytes = 100;

std::string quoted(const std::string& text) {
  if (text.size() <= max_quoted_bytes) return text;
  return shortened(text, max_quoted_bytes) + "...";
}

/// The first line of a refusal's text.
std::string_view reason(const HttpResponse& refusal) {
  const std::string_view text = *refusal.body;
  return text.substr(0, text.find('\n'));
}

std::string peer_address_of(lws* wsi) {
  std::array<char, 64> name{};
  lws_get_peer_simple(wsi, name.data(), name.size());
  return name.data();
}

/// A proxy reports how the client reached it.
bool came_by_tls(lws* wsi) {
  if (lws_is_ssl(wsi) != 0) return true;
  if (!site_of(wsi).proxies.is_proxy(peer_address_of(wsi))) return false;
  const std::string scheme = custom_header(wsi, "x-forwarded-proto:");
  return scheme == "https" || scheme == "wss";  // Traefik's name for it on websockets
}

/// Refuses a request that changes something, if another site's page sent it. `what`: for the log.
std::optional<HttpResponse> refuse_origin(lws* wsi, std::string_view what,
                                          const std::string& host) {
  const std::string origin = request_header(wsi, WSI_TOKEN_ORIGIN);
  if (origin_allowed(origin, host, site_of(wsi).allowed_origins)) return std::nullopt;
  note_refused_origin(wsi, what, origin, host);
  return text_response(403, "403: pages of this origin may not save here\n");
}

}  // namespace

const Site& site_of(lws* wsi) {
  return *static_cast<const Site*>(lws_get_vhost_user(lws_get_vhost(wsi)));
}

std::string client_address_of(lws* wsi) {
  return site_of(wsi).proxies.client_address(peer_address_of(wsi),
                                             request_header(wsi, WSI_TOKEN_X_FORWARDED_FOR));
}

std::string site_address(lws* wsi, const std::string& host) {
  if (host.empty()) return {};
  return (came_by_tls(wsi) ? "https://" : "http://") + host;
}

bool host_allowed(lws* wsi, const std::string& host) {
  const Site& site = site_of(wsi);
  if (site.names == Names::local && came_by_tls(wsi)) return true;
  return host_allowed(host, site.names, site.allowed_origins);
}

bool lacks_tls(lws* wsi) { return site_of(wsi).tls && lws_is_ssl(wsi) == 0; }

void note_refused(lws* wsi, unsigned status, std::string_view why) {
  const std::string address = client_address_of(wsi);
  const std::string code = status != 0 ? fmt::format("{}", status) : "";
  site_of(wsi).on_refused({.event = "request_refused", .address = address, .code = code},
                          fmt::format("{}: {}", address, why));
}

void note_refused_origin(lws* wsi, std::string_view what, const std::string& origin,
                         const std::string& host) {
  note_refused(wsi, 403,
               fmt::format("{} refused: origin {} is not allowed at {} (--allow-origin)", what,
                           quoted(origin), quoted(host)));
}

int refuse_request(lws* wsi, unsigned status, const char* why) {
  note_refused(wsi, status, fmt::format("request refused: {}: {}", status, why));
  lws_return_http_status(wsi, status, why);
  return -1;
}

std::optional<int> refuse_faulty_head(lws* wsi) {
  std::size_t bytes = 0;
  for (int token = 0; token < WSI_TOKEN_COUNT; ++token)
    bytes += static_cast<std::size_t>(
        std::max(0, lws_hdr_total_length(wsi, static_cast<lws_token_indexes>(token))));
  if (bytes > max_head_bytes)
    return refuse_request(wsi, 431, "the request has more than 16 KiB of headers: clear cookies");
  const std::string version = request_header(wsi, WSI_TOKEN_HTTP);
  if (version != "HTTP/1.1" && version != "HTTP/1.0")
    return refuse_request(wsi, 400, "a request line ends with HTTP/1.1 or HTTP/1.0");
  if (version == "HTTP/1.1" && request_header(wsi, WSI_TOKEN_HOST).empty())
    return refuse_request(wsi, 400, "HTTP/1.1 needs a Host");
  return std::nullopt;
}

int confirm_upgrade(lws* wsi) {
  // Do not use the callback's text: libwebsockets has already answered requests that it does not
  // know, and the text may be gone.
  if (lacks_tls(wsi)) return refuse_request(wsi, 400, "this port speaks https and wss");
  const std::string protocol = request_header(wsi, WSI_TOKEN_UPGRADE);
  if (::strcasecmp(protocol.c_str(), "websocket") == 0) {
    const std::string connection = request_header(wsi, WSI_TOKEN_CONNECTION);
    if (boost::beast::http::token_list(connection).exists("upgrade")) return 0;
    return refuse_request(wsi, 400, "a websocket needs Connection: Upgrade, through proxies, too");
  }
  if (::strcasecmp(protocol.c_str(), "h2c") == 0)
    return refuse_request(wsi, 400, "HTTP/1.1 and websockets are spoken here, not h2c");
  note_refused(wsi, 0, "request refused: it wants another protocol than websocket");
  return -1;
}

HttpResponse refuse_host(lws* wsi, const std::string& host) {
  const std::string name = quoted(host);
  note_refused(
      wsi, 403,
      fmt::format("request refused: this server is not known as {} (--allow-origin)", name));
  const bool loopback = site_of(wsi).names == Names::loopback;
  return text_response(
      403,
      fmt::format("403: this server {} and is not known as {}. Open it {}, or start it with "
                  "--allow-origin {}://{}\n",
                  loopback ? "listens on a loopback address" : "asks for no token", name,
                  loopback ? "as localhost" : "by its address", loopback ? "https" : "http", name));
}

HttpResponse respond(lws* wsi, const std::string& host, const HttpRequest& request) {
  const Site& site = site_of(wsi);
  if (!host_allowed(wsi, host)) return refuse_host(wsi, host);
  if (request.method == HttpMethod::delete_)
    if (auto refusal = refuse_origin(wsi, "request", host)) return *std::move(refusal);
  HttpResponse response = site.http(request);
  if (response.status == 401)
    note_refused(wsi, 401, fmt::format("request refused: {}", reason(response)));
  return response;
}

std::optional<HttpResponse> refuse_upload(lws* wsi) {
  const Site& site = site_of(wsi);
  const std::string host = request_header(wsi, WSI_TOKEN_HOST);
  if (!host_allowed(wsi, host)) return refuse_host(wsi, host);
  if (auto refusal = refuse_origin(wsi, "upload", host)) return refusal;
  const std::string path = request_header(wsi, WSI_TOKEN_PUT_URI);
  const std::string token = token_of(wsi);
  HttpRequest request{path, {}, false, token};
  request.method = HttpMethod::put;
  auto refusal = site.uploads.refusal(request);
  if (refusal)
    note_refused(wsi, static_cast<unsigned>(refusal->status),
                 fmt::format("upload refused: {}", reason(*refusal)));
  return refusal;
}

}  // namespace catgs
