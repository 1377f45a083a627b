#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <glm/vec2.hpp>

#include "proto/catgs.pb.h"
#include "render_core/motion/trajectory.h"
#include "render_core/scene/scene.h"
#include "tests/load/session_stats.h"
#include "tests/load/url.h"

namespace catgs::load {

using Clock = std::chrono::steady_clock;

/// Poses for a session, known once the server has said what scene it shows.
using MakeTrajectory = std::function<std::shared_ptr<const Trajectory>(const SceneHints& scene)>;

struct SessionSettings {
  Url url;
  std::string token;
  std::string scene_id;
  glm::ivec2 size_px{0};
  int fps = 60;
  int max_bitrate_kbps = 0;  // 0: the server's default
  float fov_y_rad = 1.0f;
  bool decode = false;
  bool acknowledge = true;  // false plays a client that has stopped reading its screen
  MakeTrajectory make_trajectory;
  double offset = 0.0;  // where in the trajectory to begin, share of its length
  Clock::time_point stop;
};

/// What all sessions share; must outlive them.
struct SessionContext {
  boost::asio::ssl::context& tls;
  boost::asio::thread_pool& decoders;
};

struct SessionReport {
  explicit SessionReport(double nominal_fps) : stats(nominal_fps) {}
  SessionStats stats;
  std::string renderer, encoder, server_version;  // as the last Welcome said
};

/// One client from now to `settings.stop`: connects, sends poses at the times of its trajectory,
/// receives, decodes and acknowledges frames, reconnects with backoff. Never throws for what the
/// server does: that is counted in the report. Everything runs on the awaiting executor but
/// decoding.
boost::asio::awaitable<void> run_session(SessionSettings settings, SessionContext context,
                                         SessionReport& report);

}  // namespace catgs::load
