#include "server/net/answered_connections.h"

namespace catgs {

void AnsweredConnections::add(lws* wsi) {
  lws_rx_flow_control(wsi, 0);
  connections_.push_back(wsi);
}

void AnsweredConnections::remove(lws* wsi) { std::erase(connections_, wsi); }

void AnsweredConnections::serve(lws_context* context) {
  if (connections_.empty()) return;  // the usual case costs no system call
  polled_.clear();
  for (lws* wsi : connections_) polled_.push_back({lws_get_socket_fd(wsi), POLLOUT, 0});
  if (::poll(polled_.data(), polled_.size(), 0) <= 0) return;
  const std::vector<lws*> connections = connections_;  // those that end are removed meanwhile
  for (std::size_t i = 0; i < connections.size(); ++i) {
    if (polled_[i].revents == 0) continue;
    lws_rx_flow_control(connections[i], 1);
    const bool ended = lws_service_fd(context, &polled_[i]) != 0;
    if (!ended) lws_rx_flow_control(connections[i], 0);
  }
}

}  // namespace catgs
