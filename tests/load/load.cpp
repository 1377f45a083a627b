#include "tests/load/load.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <numbers>
#include <set>
#include <thread>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include "render_core/base/error.h"
#include "render_core/motion/anchor.h"
#include "render_core/motion/camera_path.h"
#include "render_core/tools/scene_options.h"
#include "tests/load/link_proxy.h"
#include "tests/load/session.h"
#include "tests/load/waiting.h"

namespace catgs::load {
namespace {

namespace asio = boost::asio;

/// Traces are read once and shared; scripts are made for each session when its scene is known.
class TrajectoryMaker {
 public:
  TrajectoryMaker(const GroupOptions& options, double duration_s)
      : options_(options), duration_s_(duration_s) {
    if (options.traces.empty() == options.script.script.empty()) {
      throw InputError("--trace, --script", "", "one of them is needed",
                       "--script head plays recorded-like head motion");
    }
    for (const std::string& path : options.traces)
      traces_.push_back(std::make_shared<const CameraPath>(read_camera_path(path)));
    // A wrong script fails now, not in each session.
    if (traces_.empty()) (void)make(0, SceneHints());
  }

  [[nodiscard]] std::shared_ptr<const Trajectory> make(int session, const SceneHints& scene) const {
    if (traces_.empty()) {
      ScriptOptions script = options_.script;
      script.seed += static_cast<std::uint64_t>(session);
      script.duration_s = duration_s_;
      constexpr int display_hz = 60;
      script.rate_hz =
          options_.pose_hz > 0 ? options_.pose_hz : std::max(display_hz, options_.wishes.fps);
      if (options_.display.judged) script.rate_hz = options_.display.hz;
      return std::make_shared<const Trajectory>(make_script(script, scene));
    }
    const auto& trace = traces_[static_cast<std::size_t>(session) % traces_.size()];
    const bool same_origin = trace->origin == scene.origin;
    if (!options_.anchor && !options_.display.judged && same_origin) return {trace, &trace->poses};
    Trajectory poses =
        options_.anchor ? anchored(trace->poses, scene) : trace->poses_about(scene.origin);
    if (options_.display.judged) poses = resample(poses, options_.display.hz);
    return std::make_shared<const Trajectory>(std::move(poses));
  }

 private:
  const GroupOptions& options_;
  double duration_s_;
  std::vector<std::shared_ptr<const CameraPath>> traces_;
};

/// With the warp that `auto` means. A page that does not warp wants no overscan either.
DisplayOptions display_of(const GroupOptions& group) {
  DisplayOptions display = group.display;
  display.depths = display.judged && display.warp == WarpMode::automatic;
  if (display.warp == WarpMode::automatic)
    display.warp = group.script.script == "orbit" ? WarpMode::plane : WarpMode::turn;
  if (display.warp == WarpMode::off) display.overscan = glm::dvec2(1.0);
  return display;
}

void check(const GroupOptions& group, double duration_s) {
  const double end_s = group.end_s > 0.0 ? group.end_s : duration_s;
  if (!(group.ramp_s >= 0.0 && group.start_s >= 0.0 && group.start_s + group.ramp_s < end_s &&
        end_s <= duration_s)) {
    throw InputError("--duration, --ramp", "", "the run must last longer than its ramp");
  }
  if (!(group.wishes.fov_y_deg > 6.0f && group.wishes.fov_y_deg < 160.0f))
    throw InputError("--fov-deg", "", "must lie between 6 and 160 degrees");
  for (const std::string& size : group.sizes) (void)parse_size("--size", size);
}

void check(const LoadOptions& options) {
  // The clock counts nanoseconds in 64 bits: an end that overflows it would lie in the past.
  constexpr double longest_run_s = 7 * 24 * 3600.0;
  if (!(options.duration_s > 0.0 && options.duration_s <= longest_run_s))
    throw InputError("--duration", "", "the run must last longer than nothing, a week at most");
  std::set<std::string> names;
  for (const GroupOptions& group : options.groups) {
    check(group, options.duration_s);
    if (!names.insert(group.name).second)
      throw InputError("clients", group.name, "there are two groups of this name");
  }
}

/// One run: what its sessions share, and the starting of them.
class Run {
 public:
  explicit Run(const LoadOptions& options) : options_(options), url_(parse_url(options.url)) {
    if (!options.insecure) {
      tls_.set_default_verify_paths();
      tls_.set_verify_mode(asio::ssl::verify_peer);
    }
    for (const GroupOptions& group : options.groups) {
      trajectories_.push_back(std::make_unique<TrajectoryMaker>(group, options.duration_s));
      sessions_ += group.sessions;
    }
  }

  RunReport run() {
    begin_us_ = now_us();
    for (std::size_t i = 0; i < options_.groups.size(); ++i) start_group(i);
    for (const TimedAction& action : options_.actions)
      asio::co_spawn(io_, act(action), asio::detached);
    io_.run();
    decoders_.join();
    if (failure_) std::rethrow_exception(failure_);
    return std::move(report_);
  }

 private:
  void start_group(std::size_t index) {
    const GroupOptions& group = options_.groups[index];
    GroupReport& report = report_.groups.emplace_back();
    report.name = group.name;
    report.nominal_fps = group.wishes.fps;
    report.series = std::make_unique<TimeSeries>(begin_us_);
    for (int i = 0; i < group.sessions; ++i) {
      report.sessions.push_back(
          std::make_unique<SessionReport>(report.nominal_fps, report.series.get()));
      start_session(group, *trajectories_[index], i, *report.sessions.back());
    }
  }

  void start_session(const GroupOptions& group, const TrajectoryMaker& trajectories, int number,
                     SessionReport& report) {
    SessionSettings settings = settings_of(group, number, report);
    settings.make_trajectory = [&trajectories, number](const SceneHints& scene) {
      return trajectories.make(number, scene);
    };
    std::unique_ptr<LinkProxy> link;
    if (group.link.shapes()) {
      const auto seed = static_cast<std::uint64_t>(number) << 16;
      link = std::make_unique<LinkProxy>(io_.get_executor(), url_.host, url_.port, group.link, seed,
                                         begin_us_);
      settings.via_port = link->port();
      asio::co_spawn(io_, link->run(), asio::detached);
    }
    ++running_;
    asio::co_spawn(io_, play(std::move(settings), std::move(link), report),
                   [this](const std::exception_ptr& error) {
                     if (error && !failure_) failure_ = error;
                     if (--running_ == 0) io_.stop();  // what is left waits for nobody
                   });
  }

  asio::awaitable<void> play(SessionSettings settings, std::unique_ptr<LinkProxy> link,
                             SessionReport& report) {
    const std::unique_ptr<LinkProxy> kept = std::move(link);  // until the session's end
    co_await wait_until(clock_time(settings.start_us));
    co_await run_session(std::move(settings), {tls_, decoders_}, report);
  }

  SessionSettings settings_of(const GroupOptions& group, int number, SessionReport& report) const {
    SessionSettings settings;
    settings.url = url_;
    settings.token = options_.token;
    settings.wishes = group.wishes;
    settings.manners = group.manners;
    settings.size_px =
        parse_size("--size", group.sizes[static_cast<std::size_t>(number) % group.sizes.size()]);
    if (!group.moving_size.empty())
      settings.moving_size_px = parse_size("--moving-size", group.moving_size);
    report.still_size_px = settings.size_px;
    settings.display = display_of(group);
    settings.manners.decode = group.manners.decode || group.display.judged;
    if (group.display.judged) {
      report.display.emplace();
      report.display->room_bytes = display_room_bytes_;
      report.display->view_px = settings.size_px;
      report.display->fov_y_rad = glm::radians(group.wishes.fov_y_deg);
    }
    // Multiples of the golden ratio spread any number of sessions evenly over a trace.
    const double golden = number * std::numbers::phi;
    settings.offset = golden - std::floor(golden);
    // At most four a session: they are kept in memory until the end.
    settings.pictures = static_cast<std::size_t>(
        group.manners.decode ? std::min(4, (options_.pictures + sessions_ - 1) / sessions_) : 0);
    settings.run_begin_us = begin_us_;
    settings.start_us =
        begin_us_ + microseconds(group.start_s + group.ramp_s * number / group.sessions);
    settings.stop_us =
        begin_us_ + microseconds(group.end_s > 0.0 ? group.end_s : options_.duration_s);
    if (group.manners.stall_for_s > 0.0) {
      settings.stall_from_us = begin_us_ + microseconds(group.manners.stall_at_s);
      // Whoever stalls for ever still ends with the run.
      settings.stall_to_us = std::min(
          settings.stop_us, settings.stall_from_us + microseconds(group.manners.stall_for_s));
    }
    return settings;
  }

  asio::awaitable<void> act(const TimedAction& action) {
    co_await wait_until(clock_time(begin_us_ + microseconds(action.at_s)));
    action.action();
    if (!action.recovers) co_return;
    for (const GroupReport& group : report_.groups) {
      for (const auto& session : group.sessions) session->stats.may_recover(now_us());
    }
  }

  const LoadOptions& options_;
  const Url url_;
  asio::ssl::context tls_{asio::ssl::context::tls_client};
  asio::io_context io_{1};
  asio::thread_pool decoders_{std::max(1u, std::thread::hardware_concurrency())};
  std::vector<std::unique_ptr<TrajectoryMaker>> trajectories_;
  int sessions_ = 0;
  int running_ = 0;
  std::int64_t begin_us_ = 0;
  const std::shared_ptr<std::size_t> display_room_bytes_ =
      std::make_shared<std::size_t>(max_display_bytes);
  RunReport report_;
  std::exception_ptr failure_;
};

}  // namespace

RunReport run_load(const LoadOptions& options) {
  check(options);
  return Run(options).run();
}

}  // namespace catgs::load
