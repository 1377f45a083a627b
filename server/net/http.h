#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace catgs {

class UploadSlot;

enum class HttpMethod { get, put, delete_ };  // HEAD is a GET without its body

/// A request, or the head of a PUT request. Other methods are answered before a handler sees them.
struct HttpRequest {
  std::string_view path;  // decoded, starts with '/', no query
  std::string_view if_none_match;
  bool accepts_gzip = false;
  std::string_view token = {};           // empty: none
  std::string_view site = {};            // "https://tours.example:8443": how the client came here
  std::vector<std::string> arguments{};  // of the query: "name=value", decoded
  std::string_view if_match = {};
  std::string_view range = {};
  std::string_view if_range = {};
  HttpMethod method = HttpMethod::get;
};

/// A body that is read from the disk piece by piece while it is sent.
struct DiskBody {
  std::uint64_t length = 0;
  /// Returns so many bytes of the body from `offset` on; fewer: the body cannot be had, and the
  /// connection is closed. May block. Called on any thread, by one at a time.
  std::function<std::string(std::uint64_t offset, std::size_t bytes)> read;
};

struct HttpResponse {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string cache_control = "no-store";
  std::string etag;       // empty: none
  bool gzip = false;      // `body` is compressed
  int retry_after_s = 0;  // 0: no header Retry-After
  std::string location;   // empty: no header Location
  std::shared_ptr<const std::string> body;
  std::shared_ptr<const DiskBody> disk_body{};  // in place of `body`
  /// Makes a body of unknown length, in place of `body`. Returns its next piece; nothing: it is
  /// whole. An empty piece gives way to others for a moment. After an exception the connection is
  /// closed. May block. Called on any thread, by one at a time.
  std::function<std::optional<std::string>()> next_piece{};
  bool accepts_ranges = false;  // says so, in a header Accept-Ranges
  std::string content_range{};  // empty: no header Content-Range
  std::string policy{};         // its Content-Security-Policy; empty: that of the pages
  /// Makes the real answer where that takes a look at the disk; the other members then mean
  /// nothing. May block. Called on another thread.
  std::function<HttpResponse()> on_disk{};
};

inline HttpResponse text_response(int status, std::string body,
                                  std::string content_type = "text/plain; charset=utf-8") {
  HttpResponse response;
  response.status = status;
  response.content_type = std::move(content_type);
  response.body = std::make_shared<const std::string>(std::move(body));
  return response;
}

/// Status 503: another attempt may succeed.
inline HttpResponse busy_response(std::string body) {
  HttpResponse response = text_response(503, std::move(body));
  response.retry_after_s = 1;
  return response;
}

/// The entity tag (RFC 9110) of a content. Different contents get different tags.
std::string etag_of(std::string_view content);

/// The If-Match and If-None-Match headers of a request that replaces a resource. An empty one
/// demands nothing.
struct Precondition {
  std::string if_match;
  std::string if_none_match;

  /// `current` is the tag of the present resource; empty: there is none.
  [[nodiscard]] bool holds(std::string_view current) const;
};

/// Called on the network thread; must not block.
using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

/// Longer uploads, where they are allowed, have slots of their own.
inline constexpr std::size_t max_upload_bytes = 2 << 20;  // the camera of a film of ten minutes

/// Handles PUT requests. None are accepted if `take` is null. All functions are called on the
/// network thread.
struct HttpUploads {
  /// Refuses a request by its head, or returns nothing. Its origin was already allowed.
  std::function<std::optional<HttpResponse>(const HttpRequest&)> refusal;
  /// Takes a complete body. Any thread may fulfil the promise; a broken promise becomes status 503.
  /// The body's owner also holds `slot` and may drop both when the slot is abandoned.
  std::function<std::future<HttpResponse>(const HttpRequest&, std::string body,
                                          std::shared_ptr<const UploadSlot> slot)>
      take;
  /// Called when an upload finds no free slot.
  std::function<void()> on_full = [] {};
  /// The longest body for a path.
  std::function<std::size_t(std::string_view path)> most_bytes = [](std::string_view) {
    return max_upload_bytes;
  };
};

/// True if a page of `origin` may open a websocket here. `origin` looks like
/// "https://a.example:8443" and is empty if the client is no browser. The host that served the page
/// is allowed (`host` is the Host header), and so are listed origins; "*" allows all.
bool origin_allowed(std::string_view origin, std::string_view host,
                    const std::vector<std::string>& allowed);

/// Throws std::invalid_argument for an origin that no browser sends and that would never match. The
/// message suggests the form that was probably meant. `any_subdomain` also accepts
/// "https://*.a.example".
void check_origin(std::string_view text, bool any_subdomain);

/// 127.0.0.0/8, ::1, localhost.
bool is_loopback(std::string_view address);

/// The host names that a port accepts. In DNS rebinding, a foreign page resolves its own name to an
/// address of this server. Its requests carry that name in both Origin and Host, so comparing the
/// two proves nothing.
enum class Names {
  loopback,  // the port listens on a loopback address: loopback addresses and localhost
  local,     // without tokens: every address, and names that no outsider can register, which
             // have no dot or end with .local or .internal
  all,       // tokens keep foreign pages out
};

/// True if a request with this Host header is accepted. Hosts of `allowed` origins always are, as a
/// proxy may forward them. A request without a Host is too, because no browser sends one.
bool host_allowed(std::string_view host, Names names, const std::vector<std::string>& allowed);

/// Answers a plain HTTP request to a port that serves https: status 308 to the same page, or 400 if
/// `host` is none. The browser keeps the fragment, which may be a token.
HttpResponse redirect_to_https(std::string_view host, const HttpRequest& request);

/// Percent-encodes text for an address (RFC 3986): all bytes but letters, digits and `others`.
std::string percent_encoded(std::string_view text, std::string_view others = "-._~");

/// Escapes text for HTML content or a quoted attribute.
std::string escape_html(std::string_view text);

/// The Content-Security-Policy of every page. `embed_origins` may show it in a frame. It shows
/// pictures and plays films and sounds of `media_origins`, besides those of this server.
std::string content_security_policy(const std::vector<std::string>& embed_origins,
                                    const std::vector<std::string>& media_origins = {});

}  // namespace catgs
