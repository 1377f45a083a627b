#pragma once

#include <unordered_set>

#include <libwebsockets.h>

namespace catgs {

/// The HTTP connections that are being answered. libwebsockets 4.1.6 polls them for bytes that it
/// does not read. One byte after a request, or the end of the client's stream, would keep the
/// network thread busy. add() therefore disables reading. libwebsockets then does not write either,
/// so serve() triggers its writes. Network thread only.
class AnsweredConnections {
 public:
  AnsweredConnections();
  ~AnsweredConnections();
  AnsweredConnections(const AnsweredConnections&) = delete;
  AnsweredConnections& operator=(const AnsweredConnections&) = delete;

  void add(lws* wsi);
  void remove(lws* wsi);
  /// Writes to some of the connections whose sockets are writable, in turn. Call it after each
  /// lws_service(). Thousands that wait cost nothing: the kernel keeps the list of the ready ones.
  void serve(lws_context* context);

 private:
  const int epoll_;
  std::unordered_set<lws*> connections_;
};

}  // namespace catgs
