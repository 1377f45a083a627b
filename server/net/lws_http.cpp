#include "server/net/lws_http.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstring>
#include <string_view>

#include <linux/tcp.h>  // glibc's tcp_info lacks the newer fields
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

namespace catgs {
namespace {

constexpr std::size_t chunk_bytes = 64 * 1024;
constexpr int answer_timeout_s = 30;  // of who takes an upload
// A whole body; libwebsockets' own timeout begins anew with each piece of it.
constexpr lws_usec_t body_time_us = 30 * LWS_US_PER_SEC;
constexpr std::size_t max_dropped_bytes = 16 << 20;
constexpr lws_usec_t answer_poll_us = 10'000;  // authors save now and then

/// Appends response headers to a fixed buffer; remembers whether everything found room.
class HeaderWriter {
 public:
  HeaderWriter(lws* wsi, int status, std::string_view content_type, std::size_t length)
      : wsi_(wsi) {
    ok_ = lws_add_http_common_headers(wsi, static_cast<unsigned>(status),
                                      std::string(content_type).c_str(), length, &at_, end()) == 0;
  }
  void add(const char* name_with_colon, std::string_view value) {
    ok_ = ok_ &&
          lws_add_http_header_by_name(wsi_, reinterpret_cast<const unsigned char*>(name_with_colon),
                                      reinterpret_cast<const unsigned char*>(value.data()),
                                      static_cast<int>(value.size()), &at_, end()) == 0;
  }
  int finish() {
    return ok_ && lws_finalize_write_http_header(wsi_, start(), &at_, end()) == 0 ? 0 : -1;
  }

 private:
  unsigned char* start() { return buffer_.data() + LWS_PRE; }
  unsigned char* end() { return buffer_.data() + buffer_.size() - 1; }

  lws* wsi_;
  std::array<unsigned char, LWS_PRE + 4096> buffer_{};
  unsigned char* at_ = buffer_.data() + LWS_PRE;
  bool ok_ = true;
};

std::vector<std::string> query_arguments(lws* wsi) {
  constexpr int most = 16;
  std::vector<std::string> arguments;
  std::array<char, 512> text{};
  for (int i = 0; i < most; ++i) {
    const int length = lws_hdr_copy_fragment(wsi, text.data(), static_cast<int>(text.size()),
                                             WSI_TOKEN_HTTP_URI_ARGS, i);
    if (length < 0) break;
    arguments.emplace_back(text.data(), static_cast<std::size_t>(length));
  }
  return arguments;
}

/// That libwebsockets has read of this connection.
std::uintptr_t bytes_read(lws* wsi) {
  const int fd = lws_get_socket_fd(wsi);
  tcp_info info{};
  socklen_t size = sizeof info;
  int unread = 0;
  if (::getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0 ||
      ::ioctl(fd, FIONREAD, &unread) != 0)
    return 0;
  return static_cast<std::uintptr_t>(info.tcpi_bytes_received) -
         static_cast<std::uintptr_t>(unread);
}

}  // namespace

std::string request_header(lws* wsi, lws_token_indexes token) {
  const int length = lws_hdr_total_length(wsi, token);
  if (length <= 0) return {};
  std::string value(static_cast<std::size_t>(length) + 1, '\0');
  const int copied = lws_hdr_copy(wsi, value.data(), length + 1, token);
  value.resize(static_cast<std::size_t>(std::max(copied, 0)));
  return value;
}

std::string custom_header(lws* wsi, std::string_view name_with_colon) {
  const int name_length = static_cast<int>(name_with_colon.size());
  const int length = lws_hdr_custom_length(wsi, name_with_colon.data(), name_length);
  if (length <= 0) return {};
  std::string value(static_cast<std::size_t>(length) + 1, '\0');
  const int copied =
      lws_hdr_custom_copy(wsi, value.data(), length + 1, name_with_colon.data(), name_length);
  value.resize(static_cast<std::size_t>(std::max(copied, 0)));
  return value;
}

std::optional<std::uint64_t> body_length(lws* wsi) {
  const std::string text = request_header(wsi, WSI_TOKEN_HTTP_CONTENT_LENGTH);
  if (text.empty()) return 0;
  // Longer ones libwebsockets does not read, zeros in front or not, and takes 100 MiB or none.
  constexpr std::size_t max_digits = 20;
  if (text.size() > max_digits) return std::nullopt;
  std::uint64_t bytes = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), bytes);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return bytes;
}

void note_answered(lws* wsi) {
  lws_set_opaque_user_data(wsi, reinterpret_cast<void*>(bytes_read(wsi) + 1));
}

bool is_pipelined(lws* wsi) {
  const void* before = lws_get_opaque_user_data(wsi);
  return before && reinterpret_cast<std::uintptr_t>(before) == bytes_read(wsi) + 1;
}

int LwsHttpExchange::begin(lws* wsi, const HttpHandler& handler, const std::string& site,
                           const std::string& policy, bool& finished) {
  head_only_ = lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
  const std::string path = request_header(wsi, head_only_ ? WSI_TOKEN_HEAD_URI : WSI_TOKEN_GET_URI);
  const std::string if_none_match = request_header(wsi, WSI_TOKEN_HTTP_IF_NONE_MATCH);
  const std::string encodings = request_header(wsi, WSI_TOKEN_HTTP_ACCEPT_ENCODING);
  const std::string authorization = request_header(wsi, WSI_TOKEN_HTTP_AUTHORIZATION);
  response_ = handler({path, if_none_match, encodings.find("gzip") != std::string::npos,
                       authorization, site, query_arguments(wsi)});
  finished = head_only_ || !response_.body || response_.body->empty();
  return write_headers(wsi, policy);
}

int LwsHttpExchange::begin_upload(lws* wsi, std::optional<HttpResponse> refusal) {
  path_ = request_header(wsi, WSI_TOKEN_PUT_URI);
  authorization_ = request_header(wsi, WSI_TOKEN_HTTP_AUTHORIZATION);
  precondition_ = {request_header(wsi, WSI_TOKEN_HTTP_IF_MATCH),
                   request_header(wsi, WSI_TOKEN_HTTP_IF_NONE_MATCH)};
  refusal_ = std::move(refusal);
  await_body(wsi);
  return 0;
}

int LwsHttpExchange::refuse_body(lws* wsi, HttpResponse response, const std::string& policy,
                                 std::vector<std::byte>& scratch) {
  response_ = std::move(response);
  answered_ = true;
  await_body(wsi);
  bool finished = false;
  return write_headers(wsi, policy, true) == 0 ? write_body(wsi, scratch, finished) : -1;
}

void LwsHttpExchange::await_body(lws* wsi) {
  upload_ = true;
  body_due_ = true;
  lws_set_timer_usecs(wsi, body_time_us);
}

int LwsHttpExchange::take_body(std::string_view bytes) {
  if (body_due_ && !answered_ && !refusal_) {
    if (body_.size() + bytes.size() > max_upload_bytes) return -1;  // more than was announced
    body_.append(bytes);
    return 0;
  }
  dropped_bytes_ += bytes.size();
  return dropped_bytes_ <= max_dropped_bytes ? 0 : -1;
}

int LwsHttpExchange::end_body(lws* wsi, const HttpUploads& uploads, const std::string& policy,
                              bool& finished) {
  if (!body_due_) return 0;  // more has come after it: libwebsockets tells it again
  if (answered_) return -1;
  body_due_ = false;
  if (refusal_) return answer(wsi, *std::move(refusal_), policy, finished);
  HttpRequest request{path_, precondition_.if_none_match, false, authorization_};
  request.if_match = precondition_.if_match;
  answer_ = uploads.take(request, std::move(body_));
  lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, answer_timeout_s);
  lws_set_timer_usecs(wsi, answer_poll_us);
  return 0;
}

int LwsHttpExchange::on_timer(lws* wsi, const std::string& policy, bool& finished) {
  if (body_due_) return -1;
  if (!answer_.valid()) return 0;
  if (answer_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    lws_set_timer_usecs(wsi, answer_poll_us);
    return 0;
  }
  try {
    return answer(wsi, answer_.get(), policy, finished);
  } catch (const std::future_error&) {
    return answer(wsi, text_response(503, "503: the server stops\n"), policy, finished);
  }
}

int LwsHttpExchange::answer(lws* wsi, HttpResponse response, const std::string& policy,
                            bool& finished) {
  response_ = std::move(response);
  finished = !response_.body || response_.body->empty();
  if (write_headers(wsi, policy, true) != 0) return -1;
  if (!finished) lws_callback_on_writable(wsi);
  return 0;
}

/// `last`: no other request is answered on this connection.
int LwsHttpExchange::write_headers(lws* wsi, const std::string& policy, bool last) {
  HeaderWriter headers(wsi, response_.status, response_.content_type,
                       response_.body ? response_.body->size() : 0);
  headers.add("cache-control:", response_.cache_control);
  if (!response_.etag.empty()) headers.add("etag:", response_.etag);
  if (response_.gzip) headers.add("content-encoding:", "gzip");
  if (last) headers.add("connection:", "close");
  headers.add("vary:", "accept-encoding");
  headers.add("content-security-policy:", policy);
  headers.add("x-content-type-options:", "nosniff");
  headers.add("referrer-policy:", "no-referrer");
  headers.add("cross-origin-resource-policy:", "same-origin");
  return headers.finish();
}

int LwsHttpExchange::write_body(lws* wsi, std::vector<std::byte>& scratch, bool& finished) {
  const std::string& body = *response_.body;
  const std::size_t size = std::min(chunk_bytes, body.size() - written_);
  scratch.resize(LWS_PRE + size);
  std::memcpy(scratch.data() + LWS_PRE, body.data() + written_, size);
  written_ += size;
  finished = written_ == body.size();
  auto* payload = reinterpret_cast<unsigned char*>(scratch.data()) + LWS_PRE;
  const auto protocol = finished ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP;
  return lws_write(wsi, payload, size, protocol) == static_cast<int>(size) ? 0 : -1;
}

}  // namespace catgs
