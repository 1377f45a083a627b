#include "tests/load/load.h"

#include <cmath>
#include <exception>
#include <numbers>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "render_core/error.h"
#include "render_core/motion/anchor.h"
#include "render_core/tools/render_setup.h"
#include "tests/load/url.h"

namespace catgs::load {
namespace {

namespace asio = boost::asio;

/// Traces are read once and shared; scripts are made for each session when its scene is known.
class TrajectoryMaker {
 public:
  explicit TrajectoryMaker(const LoadOptions& options) : options_(options) {
    if (options.traces.empty() == options.script.script.empty()) {
      throw InputError("--trace, --script", "", "one of them is needed",
                       "--script head plays recorded-like head motion");
    }
    for (const std::string& path : options.traces) {
      traces_.push_back(std::make_shared<const Trajectory>(read_tum(path)));
    }
    // A wrong script is told now, not by each session.
    if (traces_.empty()) (void)make(0, SceneHints());
  }

  [[nodiscard]] std::shared_ptr<const Trajectory> make(int session, const SceneHints& scene) const {
    if (traces_.empty()) {
      ScriptOptions script = options_.script;
      script.seed += static_cast<std::uint64_t>(session);
      script.duration_s = options_.duration_s;
      script.rate_hz = options_.fps;
      return std::make_shared<const Trajectory>(make_script(script, scene));
    }
    const auto& trace = traces_[static_cast<std::size_t>(session) % traces_.size()];
    if (!options_.anchor) return trace;
    return std::make_shared<const Trajectory>(anchored(*trace, scene));
  }

 private:
  const LoadOptions& options_;
  std::vector<std::shared_ptr<const Trajectory>> traces_;
};

asio::awaitable<void> start_later(std::chrono::duration<double> delay, SessionSettings settings,
                                  SessionContext context, SessionReport& report) {
  asio::steady_timer timer(co_await asio::this_coro::executor,
                           std::chrono::duration_cast<Clock::duration>(delay));
  co_await timer.async_wait(asio::use_awaitable);
  co_await run_session(std::move(settings), context, report);
}

void check(const LoadOptions& options) {
  if (!(options.duration_s > 0.0 && options.ramp_s >= 0.0 && options.ramp_s < options.duration_s)) {
    throw InputError("--duration, --ramp", "", "the run must last longer than its ramp");
  }
  // The clock counts nanoseconds in 64 bits: an end that overflows it would lie in the past.
  constexpr double longest_run_s = 7 * 24 * 3600.0;
  if (options.duration_s > longest_run_s) {
    throw InputError("--duration", "", "the run may last a week at most");
  }
  if (!(options.fov_y_deg > 6.0f && options.fov_y_deg < 160.0f)) {
    throw InputError("--fov-deg", "", "must lie between 6 and 160 degrees");
  }
}

}  // namespace

SessionReports run_load(const LoadOptions& options) {
  check(options);
  const TrajectoryMaker trajectories(options);
  SessionSettings settings;
  settings.url = parse_url(options.url);
  settings.size_px = parse_size("--size", options.size);
  settings.token = options.token;
  settings.scene_id = options.scene;
  settings.fps = options.fps;
  settings.max_bitrate_kbps = options.max_bitrate_kbps;
  settings.fov_y_rad = options.fov_y_deg * std::numbers::pi_v<float> / 180.0f;
  settings.decode = options.decode;
  settings.acknowledge = options.acknowledge;

  asio::ssl::context tls(asio::ssl::context::tls_client);
  if (!options.insecure) {
    tls.set_default_verify_paths();
    tls.set_verify_mode(asio::ssl::verify_peer);
  }
  asio::io_context io(1);
  asio::thread_pool decoders(1);
  SessionReports reports;
  std::exception_ptr failure;
  settings.stop = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                     std::chrono::duration<double>(options.duration_s));
  for (int i = 0; i < options.sessions; ++i) {
    reports.push_back(std::make_unique<SessionReport>(static_cast<double>(options.fps)));
    settings.make_trajectory = [&trajectories, i](const SceneHints& scene) {
      return trajectories.make(i, scene);
    };
    // Multiples of the golden ratio spread any number of sessions evenly over a trace.
    const double golden = i * std::numbers::phi;
    settings.offset = golden - std::floor(golden);
    const std::chrono::duration<double> delay(options.ramp_s * i / options.sessions);
    asio::co_spawn(io, start_later(delay, settings, {tls, decoders}, *reports.back()),
                   [&](std::exception_ptr error) {
                     if (error && !failure) failure = error;
                   });
  }
  io.run();
  decoders.join();
  if (failure) std::rethrow_exception(failure);
  return reports;
}

}  // namespace catgs::load
