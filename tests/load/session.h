#pragma once

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
#include "tests/load/clock.h"
#include "tests/load/options.h"
#include "tests/load/run_report.h"
#include "tests/load/url.h"

namespace catgs::load {

/// Poses for a session, known once the server has said what scene it shows.
using MakeTrajectory = std::function<std::shared_ptr<const Trajectory>(const SceneHints& scene)>;

/// Times are those of now_us().
struct SessionSettings {
  Url url;
  std::string via_port;  // of a LinkProxy on this machine; empty: straight to the server
  std::string token;
  Wishes wishes;
  Manners manners;
  DisplayOptions display;  // `warp` as it is meant
  glm::ivec2 size_px{0};
  glm::ivec2 moving_size_px{0};  // 0: the same
  MakeTrajectory make_trajectory;
  double offset = 0.0;  // where in the trajectory to begin, share of its length
  std::int64_t stall_from_us = 0, stall_to_us = 0;
  std::size_t pictures = 0;  // to keep, evenly spread over its time
  std::int64_t run_begin_us = 0, start_us = 0, stop_us = 0;
};

/// Shared by all sessions; must outlive them.
struct SessionContext {
  boost::asio::ssl::context& tls;
  boost::asio::thread_pool& decoders;
};

/// One client from now to `settings.stop_us`: connects, sends poses at the times of its trajectory,
/// receives, decodes and acknowledges frames, reconnects with backoff. Never throws for what the
/// server does: that is counted in the report. Everything runs on the awaiting executor but
/// decoding.
boost::asio::awaitable<void> run_session(SessionSettings settings, SessionContext context,
                                         SessionReport& report);

}  // namespace catgs::load
