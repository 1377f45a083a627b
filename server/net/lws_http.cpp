#include "server/net/lws_http.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstring>
#include <string_view>

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include "server/net/lws_site.h"

namespace catgs {
namespace {

constexpr std::size_t chunk_bytes = 64 * 1024;
constexpr int answer_timeout_s = 30;  // until an answer is ready
constexpr int piece_timeout_s = 30;   // until the client has taken a piece of an answer
constexpr std::size_t max_dropped_bytes = 16 << 20;
constexpr lws_usec_t answer_poll_us = 10'000;  // saves are rare

/// Appends response headers to a fixed buffer; remembers whether everything found room.
class HeaderWriter {
 public:
  HeaderWriter(lws* wsi, int status, const std::string& content_type, std::uint64_t length)
      : wsi_(wsi) {
    // RFC 9110 forbids a length in a 204. In a 304 it would be that of the page.
    const bool has_content = status != 204 && status != 304;
    ok_ = lws_add_http_common_headers(
              wsi, static_cast<unsigned>(status), has_content ? content_type.c_str() : nullptr,
              has_content ? length : LWS_ILLEGAL_HTTP_CONTENT_LEN, &at_, end()) == 0;
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

template <typename Result>
bool is_ready(const std::future<Result>& result) {
  return result.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

/// libwebsockets does not report a client that closes while its answer is prepared. TCP does not
/// tell a close from a half-close, so a client that ends its sending after an upload counts as gone
/// too.
bool has_gone(lws* wsi) {
  pollfd socket{lws_get_socket_fd(wsi), POLLRDHUP, 0};
  return ::poll(&socket, 1, 0) > 0;
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

std::string token_of(lws* wsi) {
  constexpr std::string_view scheme = "Bearer ";
  const std::string header = request_header(wsi, WSI_TOKEN_HTTP_AUTHORIZATION);
  return header.starts_with(scheme) ? header.substr(scheme.size())
                                    : custom_header(wsi, "catgs-token:");
}

std::optional<std::uint64_t> body_length(lws* wsi) {
  const std::string text = request_header(wsi, WSI_TOKEN_HTTP_CONTENT_LENGTH);
  if (text.empty()) return 0;
  // libwebsockets does not parse longer values, with or without leading zeros, and assumes 100 MiB
  // or none.
  constexpr std::size_t max_digits = 20;
  if (text.size() > max_digits) return std::nullopt;
  std::uint64_t bytes = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), bytes);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return bytes;
}

int LwsHttpExchange::begin(lws* wsi, const HttpHandler& handler, const std::string& site) {
  head_only_ = lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
  const bool deletes = lws_hdr_total_length(wsi, WSI_TOKEN_DELETE_URI) > 0;
  const std::string path = request_header(wsi, head_only_ ? WSI_TOKEN_HEAD_URI
                                               : deletes  ? WSI_TOKEN_DELETE_URI
                                                          : WSI_TOKEN_GET_URI);
  const std::string if_none_match = request_header(wsi, WSI_TOKEN_HTTP_IF_NONE_MATCH);
  const std::string encodings = request_header(wsi, WSI_TOKEN_HTTP_ACCEPT_ENCODING);
  const std::string token = token_of(wsi);
  const std::string range = request_header(wsi, WSI_TOKEN_HTTP_RANGE);
  const std::string if_range = request_header(wsi, WSI_TOKEN_HTTP_IF_RANGE);
  HttpRequest request{path,  if_none_match, encodings.find("gzip") != std::string::npos,
                      token, site,          query_arguments(wsi)};
  if (deletes) request.method = HttpMethod::delete_;
  if (!head_only_) {  // RFC 9110: ranges are for GET
    request.range = range;
    request.if_range = if_range;
  }
  chunked_ = request_header(wsi, WSI_TOKEN_HTTP) != "HTTP/1.0";
  HttpResponse response = handler(request);
  serve(wsi);
  if (!response.on_disk) return answer(wsi, std::move(response));
  lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, answer_timeout_s);
  answer_ = disk_.run(std::move(response.on_disk), waiter_);
  if (!answer_.valid())
    return answer(wsi, busy_response("503: many wait for files: try again in a second\n"));
  return 0;
}

LwsHttpExchange::~LwsHttpExchange() {
  waiter_->wsi = nullptr;
  if (slot_) slot_->abandon();
}

int LwsHttpExchange::begin_upload(lws* wsi, std::shared_ptr<UploadSlot> slot, std::size_t bytes) {
  path_ = request_header(wsi, WSI_TOKEN_PUT_URI);
  token_ = token_of(wsi);
  precondition_ = {request_header(wsi, WSI_TOKEN_HTTP_IF_MATCH),
                   request_header(wsi, WSI_TOKEN_HTTP_IF_NONE_MATCH)};
  slot_ = std::move(slot);
  announced_bytes_ = bytes;
  body_.reserve(bytes);
  await_body(wsi, bytes);
  return 0;
}

int LwsHttpExchange::begin_refused_upload(lws* wsi, HttpResponse refusal) {
  refusal_ = std::move(refusal);
  await_body(wsi);
  return 0;
}

int LwsHttpExchange::refuse_body(lws* wsi, HttpResponse response, std::vector<std::byte>& scratch) {
  response_ = std::move(response);
  answered_ = true;
  await_body(wsi);
  return write_headers(wsi) == 0 ? write_piece(wsi, scratch) : -1;
}

void LwsHttpExchange::await_body(lws* wsi, std::size_t bytes) {
  body_due_.emplace(bytes, Clock::now());
  set_body_timer(wsi);
}

/// libwebsockets' own timeout restarts with each piece of a body.
void LwsHttpExchange::set_body_timer(lws* wsi) {
  const auto left = body_due_->at() - Clock::now();
  lws_set_timer_usecs(wsi, std::chrono::ceil<std::chrono::microseconds>(left).count());
}

int LwsHttpExchange::take_body(lws* wsi, std::string_view bytes) {
  if (has_gone(wsi)) return -1;
  if (body_due_) body_due_->arrived(bytes.size(), Clock::now());
  if (body_due_ && slot_) {
    if (body_.size() + bytes.size() > announced_bytes_) return -1;
    body_.append(bytes);
    return 0;
  }
  dropped_bytes_ += bytes.size();
  return dropped_bytes_ <= max_dropped_bytes ? 0 : -1;
}

int LwsHttpExchange::end_body(lws* wsi, const HttpUploads& uploads) {
  if (!body_due_ || answered_) return -1;
  body_due_.reset();
  if (refusal_) {
    serve(wsi);
    return answer(wsi, *std::move(refusal_));
  }
  HttpRequest request{path_, precondition_.if_none_match, false, token_};
  request.if_match = precondition_.if_match;
  request.method = HttpMethod::put;
  lws_rx_flow_control(wsi, 0);  // see AnsweredConnections
  answer_ = uploads.take(request, std::move(body_), slot_);
  lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, answer_timeout_s);
  lws_set_timer_usecs(wsi, answer_poll_us);
  return 0;
}

int LwsHttpExchange::on_timer(lws* wsi) {
  if (body_due_ && body_due_->at() <= Clock::now()) return -1;
  if (body_due_) set_body_timer(wsi);
  if (!answer_.valid()) return 0;
  if (!is_ready(answer_)) {
    if (has_gone(wsi)) return -1;
    lws_set_timer_usecs(wsi, answer_poll_us);
    return 0;
  }
  serve(wsi);
  return answer_now(wsi);
}

int LwsHttpExchange::answer_now(lws* wsi) {
  try {
    return answer(wsi, answer_.get());
  } catch (const std::future_error&) {
    return answer(wsi, busy_response("503: the server cannot do it now: try again in a moment\n"));
  }
}

/// From here on nothing is read.
void LwsHttpExchange::serve(lws* wsi) {
  waiter_->wsi = wsi;
  served_.add(wsi);
}

int LwsHttpExchange::answer(lws* wsi, HttpResponse response) {
  response_ = std::move(response);
  answering_ = true;
  // Counts a socket as writable only when little is unsent. Progress of a slow client is then
  // visible.
  const int unsent_bytes = 16 * 1024;
  ::setsockopt(lws_get_socket_fd(wsi), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent_bytes,
               sizeof unsent_bytes);
  lws_callback_on_writable(wsi);
  const int failed = write_headers(wsi);
  if (head_only_) unwritten_ = 0;
  read_ahead();
  return failed;
}

/// Two pieces of a body are in memory at most: this one, and the one that is being written.
void LwsHttpExchange::read_ahead() {
  if (unwritten_ == 0) return;
  if (response_.next_piece) piece_ = disk_.run(response_.next_piece, waiter_);
  if (!response_.disk_body) return;
  const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(chunk_bytes, unwritten_));
  const std::uint64_t offset = response_.disk_body->length - unwritten_;
  piece_ = disk_.run<std::optional<std::string>>(
      [body = response_.disk_body, offset, size] { return body->read(offset, size); }, waiter_);
}

int LwsHttpExchange::write_headers(lws* wsi) {
  unwritten_ = response_.next_piece  ? LWS_ILLEGAL_HTTP_CONTENT_LEN
               : response_.disk_body ? response_.disk_body->length
               : response_.body      ? response_.body->size()
                                     : 0;
  HeaderWriter headers(wsi, response_.status, response_.content_type, unwritten_);
  if (response_.next_piece && chunked_) headers.add("transfer-encoding:", "chunked");
  headers.add("cache-control:", response_.cache_control);
  if (!response_.etag.empty()) headers.add("etag:", response_.etag);
  if (!response_.location.empty()) headers.add("location:", response_.location);
  if (response_.retry_after_s > 0)
    headers.add("retry-after:", std::to_string(response_.retry_after_s));
  if (response_.gzip) headers.add("content-encoding:", "gzip");
  if (response_.accepts_ranges) headers.add("accept-ranges:", "bytes");
  if (!response_.content_range.empty()) headers.add("content-range:", response_.content_range);
  headers.add("content-security-policy:",
              response_.policy.empty() ? site_of(wsi).policy : response_.policy);
  return headers.finish();
}

int LwsHttpExchange::on_writable(lws* wsi, std::vector<std::byte>& scratch) {
  if (!answering_) return answer_.valid() && is_ready(answer_) ? answer_now(wsi) : 0;
  if (unwritten_ == 0) return -1;
  if (piece_.valid() && !is_ready(piece_)) return 0;  // its thread wakes this one
  lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, piece_timeout_s);
  lws_callback_on_writable(wsi);
  return response_.next_piece ? write_next_piece(wsi, scratch) : write_piece(wsi, scratch);
}

int LwsHttpExchange::write_next_piece(lws* wsi, std::vector<std::byte>& scratch) {
  if (!piece_.valid()) return -1;  // the disk's threads had too much to do
  const std::optional<std::string> piece = piece_.get();
  if (!piece) unwritten_ = 0;
  read_ahead();
  if (chunked_ && !piece) return write(wsi, "0\r\n\r\n", scratch);
  if (!piece || piece->empty()) return 0;
  return write(wsi, chunked_ ? fmt::format("{:x}\r\n{}\r\n", piece->size(), *piece) : *piece,
               scratch);
}

int LwsHttpExchange::write_piece(lws* wsi, std::vector<std::byte>& scratch) {
  const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(chunk_bytes, unwritten_));
  std::string_view bytes;
  std::optional<std::string> piece;
  if (piece_.valid()) {
    piece = piece_.get();
    if (!piece || piece->size() != size) return -1;
    bytes = *piece;
  } else if (response_.disk_body) {
    return -1;  // the disk's threads had too much to do
  } else {
    bytes = std::string_view(*response_.body).substr(response_.body->size() - unwritten_, size);
  }
  unwritten_ -= size;
  read_ahead();
  return write(wsi, bytes, scratch);
}

int LwsHttpExchange::write(lws* wsi, std::string_view bytes, std::vector<std::byte>& scratch) {
  scratch.resize(LWS_PRE + bytes.size());
  std::memcpy(scratch.data() + LWS_PRE, bytes.data(), bytes.size());
  auto* payload = reinterpret_cast<unsigned char*>(scratch.data()) + LWS_PRE;
  const auto protocol = unwritten_ == 0 ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP;
  return lws_write(wsi, payload, bytes.size(), protocol) == static_cast<int>(bytes.size()) ? 0 : -1;
}

}  // namespace catgs
