#pragma once

#include <string>
#include <vector>

#include <libwebsockets.h>

#include "server/net/http.h"

namespace catgs {

/// One HTTP request of libwebsockets being answered. Network thread only.
class LwsHttpExchange {
 public:
  /// Reads the request, asks `handler` and writes the response's headers. `policy` is the
  /// Content-Security-Policy. Sets `finished` when there is no body to follow.
  /// The int results below are libwebsockets': nonzero closes the connection.
  int begin(lws* wsi, const HttpHandler& handler, const std::string& policy, bool& finished);
  /// Writes the next piece of the body.
  int write_body(lws* wsi, std::vector<std::byte>& scratch, bool& finished);

 private:
  int write_headers(lws* wsi, const std::string& policy);

  HttpResponse response_;
  bool head_only_ = false;
  std::size_t written_ = 0;
};

/// Header of the request, or an empty string.
std::string request_header(lws* wsi, lws_token_indexes token);

}  // namespace catgs
