#pragma once

#include <csignal>
#include <thread>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <unistd.h>

#include "server/base/log_event.h"

namespace catgs {

/// While it lives, SIGINT and SIGTERM end the process at once with status 0. Scenes load for
/// minutes, no client is connected yet, and the loop that handles signals does not run. By default,
/// the first process of a container would ignore them, and others would not end with 0.
class StopWhileLoading {
 public:
  StopWhileLoading() {
    signals_.async_wait([](const boost::system::error_code& error, int) {
      if (error) return;
      log_info({.event = "stopped"}, "stopped while scenes were loading");
      ::_exit(0);
    });
    listener_ = std::jthread([this] { io_.run(); });  // not before there is something to wait for
  }
  ~StopWhileLoading() { io_.stop(); }
  StopWhileLoading(const StopWhileLoading&) = delete;
  StopWhileLoading& operator=(const StopWhileLoading&) = delete;

 private:
  boost::asio::io_context io_{1};
  boost::asio::signal_set signals_{io_, SIGINT, SIGTERM};
  std::jthread listener_;
};

}  // namespace catgs
