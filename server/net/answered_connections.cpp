#include "server/net/answered_connections.h"

#include <array>
#include <cerrno>
#include <system_error>

#include <poll.h>
#include <sys/epoll.h>
#include <unistd.h>

namespace catgs {

AnsweredConnections::AnsweredConnections() : epoll_(::epoll_create1(EPOLL_CLOEXEC)) {
  if (epoll_ < 0) throw std::system_error(errno, std::generic_category(), "epoll_create1");
}

AnsweredConnections::~AnsweredConnections() { ::close(epoll_); }

void AnsweredConnections::add(lws* wsi) {
  lws_rx_flow_control(wsi, 0);
  epoll_event wanted{EPOLLOUT, {.ptr = wsi}};
  if (::epoll_ctl(epoll_, EPOLL_CTL_ADD, lws_get_socket_fd(wsi), &wanted) != 0)
    throw std::system_error(errno, std::generic_category(), "epoll_ctl");
  connections_.insert(wsi);
}

void AnsweredConnections::remove(lws* wsi) {
  if (connections_.erase(wsi) > 0)
    ::epoll_ctl(epoll_, EPOLL_CTL_DEL, lws_get_socket_fd(wsi), nullptr);
}

void AnsweredConnections::serve(lws_context* context) {
  constexpr std::size_t most_at_a_time = 32;  // up to 64 KiB each: frames wait for them
  if (connections_.empty()) return;           // the usual case costs no system call
  std::array<epoll_event, most_at_a_time> ready;
  const int count = ::epoll_wait(epoll_, ready.data(), most_at_a_time, 0);
  for (int i = 0; i < count; ++i) {
    lws* const wsi = static_cast<lws*>(ready[static_cast<std::size_t>(i)].data.ptr);
    pollfd polled{lws_get_socket_fd(wsi), POLLOUT,
                  static_cast<short>(ready[static_cast<std::size_t>(i)].events)};
    lws_rx_flow_control(wsi, 1);
    const bool ended = lws_service_fd(context, &polled) != 0;
    if (ended)
      remove(wsi);  // it may still wait for the client's end
    else
      lws_rx_flow_control(wsi, 0);
  }
}

}  // namespace catgs
