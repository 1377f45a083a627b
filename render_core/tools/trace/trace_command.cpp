// catgs-render trace: makes pose streams, and checks that they are fit for measurements.
#include <functional>
#include <memory>
#include <numbers>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/motion/anchor.h"
#include "render_core/motion/camera_path.h"
#include "render_core/motion/plain_motion.h"
#include "render_core/motion/script.h"
#include "render_core/motion/trace_check.h"
#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/render_setup.h"
#include "render_core/tools/scene_options.h"

namespace catgs {
namespace {

/// Options that the subcommands share.
struct TraceOptions {
  SceneOptions scene;
  LensOptions lens{.size = "1920x1080", .focal_px = {}, .fov_y_deg = {}, .near_z = {}};
  bool force = false;
  std::string out;
};

/// Traces are judged by the motion that a perspective picture shows.
void add_perspective_options(CLI::App& command, LensOptions& lens) {
  add_lens_options(command, lens);
  command.remove_option(command.get_option("--orthographic"));
}

void add_trace_options(CLI::App& command, TraceOptions& options) {
  add_scene_options(command, options.scene);
  add_perspective_options(command, options.lens);
  command.add_flag("--force", options.force,
                   "Write the trace even if it is unfit for measurements");
  command.add_option("--out", options.out, "TUM file to write")->required();
}

struct LoadedScene {
  Scene scene;
  Bounds bounds;  // 5-95 %
};

LoadedScene load_for_trace(const TraceOptions& options, bool quiet) {
  (void)make_lens(options.lens, {});  // a mistake appears before a large scene is read
  LoadedScene loaded{load_scene(options.scene, 0, quiet), {}};
  loaded.bounds = robust_bounds(loaded.scene.cloud).value_or(Bounds{});
  return loaded;
}

/// `path`: of the file that tells the lens.
TraceCheck check(const TraceOptions& options, const LoadedScene& loaded,
                 const Trajectory& trajectory, const CameraPath& path = {}) {
  ThreadPool pool;
  const Lens lens = path.lenses.empty() ? Lens{} : path.lenses.front();
  return check_trace(trajectory, loaded.scene.cloud.mean, {loaded.bounds, loaded.scene.hints},
                     make_lens(options.lens, loaded.scene.hints, lens), pool);
}

void print_checked(const std::string& file, const TraceCheck& result) {
  fmt::print("{}: {} frames, {:.1f} % of them see enough, all in or around the scene\n", file,
             result.frames, 100.0 * result.seeing_frames);
}

void write_checked(const TraceOptions& options, const LoadedScene& loaded,
                   const Trajectory& trajectory, bool quiet, const CameraPath& path = {}) {
  const TraceCheck result = check(options, loaded, trajectory, path);
  if (!result.valid() && !options.force) {
    throw CheckFailed(
        fmt::format("{}: not written: {}; --force writes it", options.out, result.complaint()));
  }
  write_tum(options.out, trajectory, loaded.scene.hints.origin);
  if (!result.valid()) {
    fmt::print(stderr, "catgs-render: {}: {}\n", options.out, result.complaint());
  } else if (!quiet) {
    print_checked(options.out, result);
  }
}

void add_script(CLI::App& trace) {
  struct Options {
    SceneOptions scene;
    ScriptOptions script;
    std::string out;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = trace.add_subcommand("script", "Writes a scripted trace for a scene");
  add_scene_options(*command, options->scene);
  command
      ->add_option("--script", options->script.script,
                   "orbit, walk, head, drone, still or tour:FILE (a camera path of keyframes)")
      ->required();
  command->add_option("--seed", options->script.seed, "The same seed gives the same trace")
      ->capture_default_str();
  command->add_option("--duration", options->script.duration_s, "Seconds")->capture_default_str();
  command->add_option("--fps", options->script.rate_hz, "Poses per second")->capture_default_str();
  command->add_option("--out", options->out, "TUM file to write")->required();
  command->callback([options, command] {
    const Scene scene = load_scene(options->scene, 0, is_quiet(*command));
    write_tum(options->out, make_script(options->script, scene.hints), scene.hints.origin);
  });
}

void add_anchor(CLI::App& trace) {
  struct Options : TraceOptions {
    std::string trace;
    double trace_rate_hz = default_pose_rate_hz;
    std::optional<double> rate_hz;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = trace.add_subcommand(
      "anchor", "Moves a recorded trace to a scene's start pose, upright and with its heading");
  add_trace_options(*command, *options);
  command
      ->add_option("--trace", options->trace,
                   fmt::format("Camera path whose up is -y: {}", camera_path_forms))
      ->required();
  add_trace_rate_option(*command, options->trace_rate_hz);
  command
      ->add_option("--fps", options->rate_hz,
                   "Resample to this rate (default: keep the recorded samples)")
      ->check(CLI::Range(1.0, 1000.0));
  command->callback([options, command] {
    const bool quiet = is_quiet(*command);
    const CameraPath recorded = read_camera_path(options->trace, options->trace_rate_hz);
    const LoadedScene loaded = load_for_trace(*options, quiet);
    const Trajectory moved = anchored(recorded.poses, loaded.scene.hints);
    write_checked(*options, loaded, options->rate_hz ? resample(moved, *options->rate_hz) : moved,
                  quiet, recorded);
  });
}

struct MotionCommand {
  const char* name;
  const char* description;
  MotionKind kind;
  double default_speed;  // as on the command line
};

void add_motion(CLI::App& trace, const MotionCommand& how) {
  struct Options : TraceOptions {
    PlainMotion motion;
  };
  auto options = std::make_shared<Options>();
  options->motion.kind = how.kind;
  options->motion.speed = how.default_speed;
  CLI::App* command = trace.add_subcommand(how.name, how.description);
  add_trace_options(*command, *options);
  const bool straight = how.kind == MotionKind::pan || how.kind == MotionKind::zoom;
  command
      ->add_option("--speed", options->motion.speed,
                   straight ? "World units per second" : "Degrees per second")
      ->capture_default_str();
  if (straight) {
    command->add_option(
        "--reach", options->motion.reach,
        "Largest distance from the start, world units (default: the scene's bounds)");
  }
  command->add_option("--duration", options->motion.duration_s, "Seconds")->capture_default_str();
  command->add_option("--fps", options->motion.rate_hz, "Poses per second")->capture_default_str();
  command->callback([options, command, straight] {
    const bool quiet = is_quiet(*command);
    const LoadedScene loaded = load_for_trace(*options, quiet);
    PlainMotion motion = options->motion;
    if (!straight) motion.speed *= std::numbers::pi / 180.0;
    write_checked(*options, loaded, make_plain_motion(motion, loaded.scene.hints, loaded.bounds),
                  quiet);
  });
}

void add_check(CLI::App& trace) {
  struct Options : TraceOptions {
    std::string trace;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command =
      trace.add_subcommand("check", "Checks whether a trace is fit for measurements");
  add_scene_options(*command, options->scene);
  add_perspective_options(*command, options->lens);
  command->add_option("--trace", options->trace, fmt::format("Camera path: {}", camera_path_forms))
      ->required();
  command->callback([options, command] {
    const CameraPath path = read_camera_path(options->trace);
    const LoadedScene loaded = load_for_trace(*options, is_quiet(*command));
    const TraceCheck result =
        check(*options, loaded, path.poses_about(loaded.scene.hints.origin), path);
    if (!result.valid()) {
      throw CheckFailed(fmt::format("{}: {}", options->trace, result.complaint()));
    }
    print_checked(options->trace, result);
  });
}

}  // namespace

void add_trace_command(CLI::App& app) {
  CLI::App* trace = app.add_subcommand("trace", "Makes and checks camera traces (TUM files)");
  trace->require_subcommand(1);
  add_anchor(*trace);
  add_motion(*trace, {"orbit", "Around the scene's focus", MotionKind::orbit, 20.0});
  add_motion(*trace, {"pan", "Sideways, to and fro", MotionKind::pan, 1.0});
  add_motion(*trace, {"zoom", "Along the view, to and fro", MotionKind::zoom, 1.0});
  add_motion(*trace, {"rotate", "On the spot", MotionKind::rotate, 30.0});
  add_script(*trace);
  add_check(*trace);
  add_trace_windows_command(*trace);
}

}  // namespace catgs
