#pragma once

#include <cstdint>
#include <future>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <libwebsockets.h>

#include "server/net/http.h"

namespace catgs {

/// Answers the one HTTP request of a connection. Network thread only. The int results are those of
/// libwebsockets' callbacks: nonzero closes the connection.
class LwsHttpExchange {
 public:
  /// Reads the request, asks `handler` and begins to answer. `site`: HttpRequest::site.
  int begin(lws* wsi, const HttpHandler& handler, const std::string& site);
  /// A PUT request: its body follows, of a length that is known to be small. `refusal`: what it
  /// will be answered then, whatever it is.
  int begin_upload(lws* wsi, std::optional<HttpResponse> refusal);
  /// A PUT request whose body is not wanted: it is answered now. What comes of the body is read and
  /// dropped, within bounds, because a connection that is closed with bytes unread is reset, and
  /// then the client may not see the answer. It is written at once and not when the socket is
  /// writable, as headers always are: it is a line longer, nothing else is on its way on this
  /// connection, and libwebsockets keeps what the socket does not take.
  int refuse_body(lws* wsi, HttpResponse response, std::vector<std::byte>& scratch);
  /// A piece of a body. Only that of an upload which is not refused is kept.
  int take_body(std::string_view bytes);
  /// The body is whole; that of an upload is what `uploads` is asked to take. Calls of on_timer()
  /// follow, by LWS_CALLBACK_TIMER.
  int end_body(lws* wsi, const HttpUploads& uploads);
  /// The answer may have come, or the body's time is over.
  int on_timer(lws* wsi);
  /// Writes the next piece of the answer. The connection closes once the socket has them all.
  int on_writable(lws* wsi, std::vector<std::byte>& scratch);

 private:
  void await_body(lws* wsi);
  int answer(lws* wsi, HttpResponse response);
  int write_headers(lws* wsi);
  int write_piece(lws* wsi, std::vector<std::byte>& scratch);

  HttpResponse response_;
  bool answering_ = false;
  std::size_t unwritten_ = 0;  // bytes of the body

  // Of uploads. The request's head is gone when its body has come.
  std::string path_;
  std::string authorization_;
  Precondition precondition_;
  std::string body_;
  std::optional<HttpResponse> refusal_;
  bool answered_ = false;          // before its body has come
  std::size_t dropped_bytes_ = 0;  // of a body that is not wanted
  // By the timer. LWS_SET_TIMER_USEC_CANCEL does not take it back: lws_set_timer_usecs() of 4.1.6
  // adds it to the time of day like any other, so that the timer fires at once.
  bool body_due_ = false;
  std::future<HttpResponse> answer_;
};

/// Header of the request that libwebsockets has no token for ("x-forwarded-proto:"), or an empty
/// string.
std::string custom_header(lws* wsi, std::string_view name_with_colon);

/// Header of the request, or an empty string.
std::string request_header(lws* wsi, lws_token_indexes token);

/// Of the request; 0: it does not say; nothing: what it says is no length.
std::optional<std::uint64_t> body_length(lws* wsi);

}  // namespace catgs
