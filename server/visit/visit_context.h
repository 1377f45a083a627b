#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <boost/asio/io_context.hpp>

#include "render_core/base/device_set.h"
#include "server/access/authorize.h"
#include "server/access/session_tokens.h"
#include "server/base/clock.h"
#include "server/base/metrics.h"
#include "server/counts/visit_counts.h"
#include "server/encode/encoder_choices.h"
#include "server/scenes/scene_source.h"
#include "server/schedule/frame_executor.h"
#include "server/visit/encoder_effort.h"
#include "server/visit/frames.h"
#include "server/visit/visit_policy.h"

namespace catgs {

struct VisitOptions {
  VisitPolicy policy;
  int max_sessions = 16;
  int min_fps = 10;  // guaranteed by admission; 0: admission only counts sessions
  /// Seconds of processor time a second that the server may use. It may change.
  std::function<double()> cpus = [] { return 1.0; };
  EffortControl::Range presets;
  int max_sessions_per_address = 64;  // a museum behind one address
  int max_queue = 64;                 // clients that wait for a slot
  int max_spectators = 16;            // per session
  int max_greeting = 64;              // further connections without an accepted hello
  std::function<std::int64_t()> wall_clock_s = unix_now_s;  // for tokens; may jump, also backwards
  std::function<void()> on_tick = [] {};  // proves that the session thread is alive
};

/// The parts of the server that visits use.
struct VisitContext {
  boost::asio::io_context& io;  // its thread is the session thread
  VisitOptions options;
  std::shared_ptr<FrameExecutor> executor;
  DeviceSet& devices;  // GPUs that render
  Frames& frames;
  SceneSource& scenes;
  std::vector<EncoderChoice> encoders;  // best first, not empty
  Authorize authorize;
  SessionTokens tokens;
  Metrics& metrics;
  VisitCounts* counts = nullptr;  // null: visits are not counted
  std::function<RevokedLinks()> revoked_links = [] { return std::make_shared<LinkIds>(); };
};

}  // namespace catgs
