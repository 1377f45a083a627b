#pragma once

#include <vector>

#include <libwebsockets.h>
#include <poll.h>

namespace catgs {

/// The HTTP connections that are being answered. libwebsockets 4.1.6 polls them for bytes that it
/// does not read. One byte after a request, or the end of the client's stream, would keep the
/// network thread busy. add() therefore disables reading. libwebsockets then does not write either,
/// so serve() triggers its writes. Network thread only.
class AnsweredConnections {
 public:
  void add(lws* wsi);
  void remove(lws* wsi);
  /// Writes to the connections whose sockets are writable. Call it after each lws_service().
  void serve(lws_context* context);

 private:
  std::vector<lws*> connections_;
  std::vector<pollfd> polled_;
};

}  // namespace catgs
