#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>

#include "server/base/clock.h"
#include "server/base/stop_while_loading.h"

namespace catgs {

class NetServer;
class Sessions;
class SidecarSaver;
struct ServerConfig;

/// Stops the server on SIGINT, SIGTERM or request, as Server::run() says. Session thread.
class GracefulStop {
 public:
  /// `io` runs the session thread. Until start(), a signal ends the process at once.
  explicit GracefulStop(boost::asio::io_context& io) : signals_(io), timer_(io) {}

  /// The parts to stop. All outlive this object.
  struct Parts {
    const ServerConfig& config;
    std::atomic<bool>& ready;
    Sessions& sessions;
    SidecarSaver& saver;
    NetServer& net;
  };
  /// From now on signals stop the server.
  void start(const Parts& parts);
  /// Somebody at a terminal waits for the prompt: clients move at once, and get a second.
  void begin_quickly();
  /// This server cannot serve any more: clients move in the same way.
  void give_up(const std::string& why);
  /// Why the server gave up; empty: it was asked to stop.
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  void wait_for_signal();
  /// Ends readiness. Clients are asked to move after `wait` and closed after a further `deadline`.
  void begin(std::chrono::milliseconds wait, std::chrono::milliseconds deadline);
  void drain(std::chrono::milliseconds deadline);
  /// Calls `then` when no client is connected or saving, at the latest at `deadline`.
  void when_empty(TimePoint deadline, std::function<void()> then);
  void finish();

  std::optional<StopWhileLoading> while_loading_{std::in_place};
  std::optional<Parts> parts_;
  boost::asio::signal_set signals_;
  boost::asio::steady_timer timer_;
  bool begun_ = false;
  std::string failure_;
};

}  // namespace catgs
