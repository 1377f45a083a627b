#pragma once

#include <csignal>
#include <thread>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <spdlog/spdlog.h>
#include <unistd.h>

namespace catgs {

/// For as long as it lives, SIGINT and SIGTERM end the process at once, with status 0: scenes load
/// for minutes, nobody is connected yet, and the loop that will hear signals does not run. Left to
/// the kernel, the first process of a container would not end at all, and others not with 0.
class StopWhileLoading {
 public:
  StopWhileLoading() {
    signals_.async_wait([](const boost::system::error_code& error, int) {
      if (error) return;
      spdlog::info("stopped while scenes were loading");
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
