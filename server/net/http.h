#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace catgs {

/// A GET or HEAD request, or the head of a PUT request; other methods are answered before a handler
/// sees them.
struct HttpRequest {
  std::string_view path;  // decoded, starts with '/', no query
  std::string_view if_none_match;
  bool accepts_gzip = false;
  std::string_view authorization = {};   // the header, as it came
  std::string_view site = {};            // "https://tours.example:8443": how the client came here
  std::vector<std::string> arguments{};  // of the query: "name=value", decoded
  std::string_view if_match = {};
};

struct HttpResponse {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string cache_control = "no-store";
  std::string etag;   // empty: none
  bool gzip = false;  // `body` is compressed
  std::shared_ptr<const std::string> body;
};

inline HttpResponse text_response(int status, std::string body,
                                  std::string content_type = "text/plain; charset=utf-8") {
  HttpResponse response;
  response.status = status;
  response.content_type = std::move(content_type);
  response.body = std::make_shared<const std::string>(std::move(body));
  return response;
}

/// The entity tag (RFC 9110) of a content: another content has another one.
std::string etag_of(std::string_view content);

/// What a request that replaces something asks of what is there: headers If-Match and
/// If-None-Match. An empty one asks nothing.
struct Precondition {
  std::string if_match;
  std::string if_none_match;

  /// `current`: the tag of what is there; empty: nothing is.
  [[nodiscard]] bool holds(std::string_view current) const;
};

/// Called on the network thread: answers at once and never waits.
using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

/// Takes PUT requests; none are taken where its members are null. Both are called on the network
/// thread.
struct HttpUploads {
  /// By the request's head: the refusal, or nothing. It has come from an allowed origin.
  std::function<std::optional<HttpResponse>(const HttpRequest&)> refusal;
  /// With the whole body. The answer may come from any thread; an abandoned one becomes status 503.
  std::function<std::future<HttpResponse>(const HttpRequest&, std::string body)> take;
};
inline constexpr std::size_t max_upload_bytes = 1 << 20;

/// May a page of `origin` ("https://a.example:8443", empty when the client is no browser) open a
/// websocket here? Yes when it was served by this host (`host` is the Host header) or is listed;
/// "*" lists every origin.
bool origin_allowed(std::string_view origin, std::string_view host,
                    const std::vector<std::string>& allowed);

/// Throws std::invalid_argument where no browser writes this origin, so that it would match none,
/// with the form that was probably meant. `any_subdomain`: "https://*.a.example" is good too.
void check_origin(std::string_view text, bool any_subdomain);

/// 127.0.0.0/8, ::1, localhost.
bool is_loopback(std::string_view address);

/// The names that a port answers to. A foreign page may let its own name resolve to an address of
/// this server (DNS rebinding). Its requests then carry that name both in Origin and in Host, so
/// comparing the two proves nothing.
enum class Names {
  loopback,  // the port listens on a loopback address: loopback addresses and localhost
  local,     // it asks for no token: every address, and names that no outsider can register, which
             // have no dot or end with .local or .internal
  all,       // tokens keep foreign pages out
};

/// Is a request with this Host header for us? Hosts of `allowed` origins always are (a proxy may
/// forward them), and so is a request without a Host, which no browser sends.
bool host_allowed(std::string_view host, Names names, const std::vector<std::string>& allowed);

/// The id in "/api/scenes/ID<what>".
std::optional<std::string_view> scene_of(std::string_view path, std::string_view what);

/// As text, or as an attribute in quotes, of an HTML page.
std::string escape_html(std::string_view text);

/// Security headers of every page. `embed_origins`: who may show it in a frame.
std::string content_security_policy(const std::vector<std::string>& embed_origins);

}  // namespace catgs
