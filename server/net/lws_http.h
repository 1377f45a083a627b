#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <libwebsockets.h>

#include "server/net/answered_connections.h"
#include "server/net/body_deadline.h"
#include "server/net/disk_jobs.h"
#include "server/net/http.h"
#include "server/net/upload_slots.h"

namespace catgs {

/// Answers the one HTTP request of a connection. Network thread only. The int results are those of
/// libwebsockets callbacks: nonzero closes the connection.
class LwsHttpExchange {
 public:
  /// The connection is added to `served` when its answer begins. Both outlive the exchange.
  LwsHttpExchange(AnsweredConnections& served, DiskJobs& disk) : served_(served), disk_(disk) {}
  ~LwsHttpExchange();  // the connection is closed
  LwsHttpExchange(const LwsHttpExchange&) = delete;
  LwsHttpExchange& operator=(const LwsHttpExchange&) = delete;

  /// Reads the request, asks `handler` and begins to answer, or to prepare the answer on the disk's
  /// threads. `site`: HttpRequest::site.
  int begin(lws* wsi, const HttpHandler& handler, const std::string& site);
  /// Accepts a PUT request. Its body of so many bytes is kept in `slot`.
  int begin_upload(lws* wsi, std::shared_ptr<UploadSlot> slot, std::size_t bytes);
  /// Refuses a PUT request after its body has arrived. The body is dropped.
  int begin_refused_upload(lws* wsi, HttpResponse refusal);
  /// Refuses a PUT request at once. The rest of the body is read and dropped, within bounds:
  /// closing with unread bytes resets the connection, and the client may lose the answer. The
  /// answer is written now, not when the socket is writable, just as headers are. It is only one
  /// line longer, nothing else is in flight, and libwebsockets buffers the rest.
  int refuse_body(lws* wsi, HttpResponse response, std::vector<std::byte>& scratch);
  /// Takes a piece of a body. It is kept only for an upload that has a slot.
  int take_body(lws* wsi, std::string_view bytes);
  /// The body is complete. An upload's body is handed to `uploads`. on_timer() is then called by
  /// LWS_CALLBACK_TIMER.
  int end_body(lws* wsi, const HttpUploads& uploads);
  /// Checks whether the answer is ready or the body is overdue.
  int on_timer(lws* wsi);
  /// Begins an answer that has become ready, or writes the next piece of it. The connection closes
  /// when all are written.
  int on_writable(lws* wsi, std::vector<std::byte>& scratch);

 private:
  /// The connection, for the disk's threads; null once it is closed.
  struct Waiter : Wakeable {
    lws* wsi = nullptr;
    void service_woken() override {
      if (wsi) lws_callback_on_writable(wsi);
    }
  };

  void await_body(lws* wsi, std::size_t bytes = 0);
  void set_body_timer(lws* wsi);
  int answer_now(lws* wsi);
  int answer(lws* wsi, HttpResponse response);
  void serve(lws* wsi);
  void read_ahead();
  int write_headers(lws* wsi);
  int write_piece(lws* wsi, std::vector<std::byte>& scratch);
  int write_next_piece(lws* wsi, std::vector<std::byte>& scratch);
  int write(lws* wsi, std::string_view bytes, std::vector<std::byte>& scratch);

  AnsweredConnections& served_;
  DiskJobs& disk_;
  const std::shared_ptr<Waiter> waiter_ = std::make_shared<Waiter>();
  HttpResponse response_;
  bool head_only_ = false;
  bool answering_ = false;
  std::uint64_t unwritten_ = 0;  // bytes of the body; of unknown length: not 0 until it is whole
  bool chunked_ = true;          // a body of unknown length is, but for clients of HTTP/1.0
  std::future<std::optional<std::string>> piece_;  // of a body that others make: the next one

  // Uploads only. The request's head is gone by the time its body is complete.
  std::string path_;
  std::string token_;
  Precondition precondition_;
  std::shared_ptr<UploadSlot> slot_;
  std::size_t announced_bytes_ = 0;
  std::string body_;
  std::optional<HttpResponse> refusal_;
  bool answered_ = false;          // before its body arrived
  std::size_t dropped_bytes_ = 0;  // of a refused body
  // The timer ends a body that is due, or looks for the answer. LWS_SET_TIMER_USEC_CANCEL does not
  // cancel it: lws_set_timer_usecs() of 4.1.6 adds it to the time of day like any other value, so
  // the timer fires at once.
  std::optional<BodyDeadline> body_due_;
  std::future<HttpResponse> answer_;
};

/// Returns a request header that libwebsockets has no token for ("x-forwarded-proto:"), or an empty
/// string.
std::string custom_header(lws* wsi, std::string_view name_with_colon);

/// Returns the token of "Authorization: Bearer TOKEN", or else of "catgs-token: TOKEN". Pages send
/// the latter, because a proxy with a login of its own uses Authorization. Empty: neither.
std::string token_of(lws* wsi);

/// Returns a request header, or an empty string.
std::string request_header(lws* wsi, lws_token_indexes token);

/// Returns the request's Content-Length; 0: none given; nothing: it is not a valid length.
std::optional<std::uint64_t> body_length(lws* wsi);

}  // namespace catgs
