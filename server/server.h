#pragma once

#include <functional>
#include <memory>

#include "server/base/clock.h"
#include "server/config/config.h"

namespace catgs {

class FrameExecutor;

/// Parts of a server that a test may replace.
struct ServerParts {
  /// Wraps the executor, to observe it or to make it fail.
  std::function<std::shared_ptr<FrameExecutor>(std::shared_ptr<FrameExecutor> executor)> wrap{};
  std::function<TimePoint()> liveness_clock = Clock::now;  // by which /healthz judges
};

/// The whole server, assembled from a validated configuration.
class Server {
 public:
  /// Binds the ports, loads the scenes, probes the encoders. Meanwhile, and until run(), SIGINT and
  /// SIGTERM end the whole process with status 0. Throws InputError, or DevicesUnusable.
  explicit Server(const ServerConfig& config, const ServerParts& parts = {});
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Serves until SIGINT, SIGTERM or stop(). Then readiness ends, clients move, and run()
  /// returns when they have left, within two seconds. On SIGTERM, --drain-wait and --drain-deadline
  /// give proxies and clients more time. A second signal ends the process at once.
  ///
  /// If no device renders any more or the network thread fails, clients move in the same way.
  /// run() then throws std::runtime_error. If a thread that serves visitors stalls for minutes, the
  /// process ends with status 1.
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
