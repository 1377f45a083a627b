#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "render_core/motion/trajectory.h"

namespace catgs::load {

struct RecordOptions {
  std::string url;              // of the server: ws://HOST:PORT or wss://HOST:PORT
  bool insecure = false;        // any certificate of the server will do
  std::uint16_t listen = 8081;  // on the loopback interface; 0: the system chooses
  double duration_s = 0.0;      // 0: until SIGINT or SIGTERM
  /// Called once it listens, with the port.
  std::function<void(std::uint16_t)> on_listening;
};

/// Stands between a browser and the server, carries everything on unchanged, and keeps the poses
/// that the browser sends: those of the first connection that sends any. Their times are those of
/// the browser's clock, from the first on. The browser comes over plain HTTP, which on this machine
/// is a secure context; to a wss:// server the rest of the way is encrypted. Throws InputError
/// where it cannot listen.
Trajectory record_poses(const RecordOptions& options);

}  // namespace catgs::load
