#pragma once

#include <memory>

#include "server/config.h"

namespace catgs {

/// The whole server, assembled from a validated configuration.
class Server {
 public:
  /// Binds the ports, loads the scenes, probes the encoders. Throws InputError.
  explicit Server(const ServerConfig& config);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Serves until SIGINT, SIGTERM or stop(): then readiness ends, clients are told, and run()
  /// returns when they have left, within two seconds; on SIGTERM --drain-wait and --drain-deadline
  /// give proxies and clients more time. A second signal ends the process at once.
  void run();
  /// Any thread.
  void stop();

  [[nodiscard]] int port() const;
  [[nodiscard]] int admin_port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace catgs
