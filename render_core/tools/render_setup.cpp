#include "render_core/tools/render_setup.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/motion/anchor.h"
#include "render_core/motion/camera_path.h"
#include "render_core/reference/reference.h"
#include "render_core/scene/tree/tree_file.h"
#include "render_core/tools/parse_values.h"
#include "render_core/tools/scene_hash.h"

namespace catgs {
namespace {

constexpr float default_eye_distance_m = 0.064f;

double mean_rate_hz(const Trajectory& path) {
  if (path.size() < 2) return 1.0;
  return static_cast<double>(path.size() - 1) * 1e6 /
         static_cast<double>(path.back().time_us - path.front().time_us);
}

const std::string& path_file(const RenderOptions& options) {
  return options.trace.empty() ? options.script : options.trace;
}

/// Makes the path that of the frames: other poses than those of its file have no names, and one
/// lens.
void follow(CameraPath& path, const RenderOptions& options, Trajectory poses) {
  path.poses = std::move(poses);
  path.names.clear();
  if (path.lenses.empty()) return;
  const auto differs = [&](const Lens& lens) { return lens != path.lenses.front(); };
  if (std::ranges::any_of(path.lenses, differs) && !options.lens.view_given())
    throw InputError(path_file(options), "", "its cameras have several lenses",
                     "draw pictures without --fps, or choose one with --fov-deg or --focal-px");
  path.lenses.resize(1);
}

/// The recorded or scripted path. A tour has the lens of its keyframes, if they have one.
CameraPath make_path(const RenderOptions& options, const SceneHints& hints) {
  if (options.trace.empty() == options.script.empty()) {
    throw InputError("--trace, --script", "", "one of them is needed",
                     "--script orbit is a good start");
  }
  CameraPath path;
  if (!options.script.empty()) {
    if (const auto keyframes = tour_file(options.script)) path = read_camera_path(*keyframes);
    follow(path, options, make_script(script_options(options), hints));
  } else {
    path = read_camera_path(options.trace, options.trace_rate_hz);
    path.poses = options.anchor ? anchored(path.poses, hints) : path.poses_about(hints.origin);
  }
  return path;
}

void select_frames(CameraPath& path, const FrameRange& range) {
  const auto select = [&, count = path.poses.size()](auto& values) {
    if (values.size() != count) return;
    values.erase(values.begin() + static_cast<std::ptrdiff_t>(range.end), values.end());
    values.erase(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(range.begin));
  };
  select(path.names);
  select(path.lenses);
  select(path.poses);
}

/// Returns the lenses of the frames: one for each, or one, or none.
std::vector<Lens> use_path(RenderSetup& setup, const RenderOptions& options, CameraPath path) {
  setup.samples = path.poses;
  std::optional<double> fps = options.fps;
  if (!fps && options.most_fps && mean_rate_hz(path.poses) > *options.most_fps)
    fps = options.most_fps;
  if (fps && !options.trace.empty()) follow(path, options, resample(setup.samples, *fps));
  setup.fps = fps.value_or(mean_rate_hz(path.poses));
  const FrameRange range = parse_frame_range(options.frames, path.poses.size());
  setup.first = range.begin;
  select_frames(path, range);
  setup.poses = std::move(path.poses);
  setup.names = std::move(path.names);
  return std::move(path.lenses);
}

}  // namespace

void add_render_options(CLI::App& command, RenderOptions& options) {
  add_scene_options(command, options.scene);
  auto* trace = command.add_option(
      "--trace", options.trace,
      fmt::format("Camera path: {}. Its size and its lens are used unless --size, and --fov-deg or "
                  "--focal-px, are given",
                  camera_path_forms));
  auto* script = command.add_option("--script", options.script,
                                    "Camera path: orbit, walk, head, drone, still or tour:FILE");
  trace->excludes(script);
  command.add_flag("--anchor", options.anchor, "Move the trace to the scene's start pose")
      ->needs(trace);
  add_frame_options(command, options);
  add_pipeline_options(command, options.pipeline);
}

void add_trace_rate_option(CLI::App& command, double& rate_hz) {
  command
      .add_option("--trace-rate", rate_hz,
                  "Poses per second of a path whose file has no times, like photographs")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
}

void add_frame_options(CLI::App& command, RenderOptions& options) {
  const ScriptOptions defaults;
  add_trace_rate_option(command, options.trace_rate_hz);
  command.add_option("--seed", options.seed, fmt::format("Seed of the script ({})", defaults.seed));
  command.add_option("--duration", options.duration_s,
                     fmt::format("Length of the script, seconds ({})", defaults.duration_s));
  command.add_option(
      "--fps", options.fps,
      "Frames per second (default: the rate of the trace, or 120 for a script). The trace is "
      "resampled, but forecasts use its recorded samples only, and none of the future");
  command.add_option("--frames", options.frames,
                     "Render frames A to B - 1 of the path, given as A:B");
  add_lens_options(command, options.lens);
  command.add_option("--renderer", options.renderer, "Core: auto, cpu, cuda or reference")
      ->capture_default_str();
  command.add_option("--device", options.device,
                     "CUDA core: all, or numbers of CUDA devices, like 0 or 0,1 [0]");
  command
      .add_option(
          "--detail", options.detail_px,
          "Trees: largest error in pixels that is drawn; 0: every Gaussian. The scene stays "
          "on disk, and what a picture needs is read [the whole scene is loaded]")
      ->check(CLI::Range(0.0, 64.0));
  command
      .add_option(
          "--scene-memory", options.scene_memory_gb,
          "Trees: memory for the parts of the scene that are read, GB, on each device [4.3]")
      ->check(CLI::Range(0.001, 10'000.0));
  command.add_option("--simd", options.simd, "CPU core: auto, scalar or a target's name")
      ->capture_default_str();
  command.add_option("--threads", options.threads, "Number of threads; 0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

void add_stereo_options(CLI::App& command, RenderOptions& options) {
  auto* stereo = command.add_flag(
      "--stereo", options.stereo,
      "Draw both eyes side by side, the left one left. --size and the lens are those of an eye, so "
      "pictures are twice as wide; the path is that of the head. All frames are key frames");
  stereo->excludes(command.get_option("--orthographic"));
  command
      .add_option("--eye-distance", options.eye_distance,
                  fmt::format("From eye to eye, world units [{} m, or units where the sidecar does "
                              "not say how long they are]",
                              default_eye_distance_m))
      ->check(CLI::Range(0.0, 1000.0))
      ->needs(stereo);
}

FrameRequest RenderSetup::request(std::size_t i) const {
  assert(i < poses.size());
  FrameRequest request;
  request.camera = lenses.empty() ? camera : lenses[i];
  request.camera.world_from_camera = poses[i].world_from_camera;
  if (eye_distance) {
    request.stereo = eyes_like(request.camera, *eye_distance);
    request.camera.size_px.x *= 2;
  }
  request.background = background;
  request.detail_px = detail_px;
  request.waits_for_pages = true;
  return request;
}

std::uint64_t RenderSetup::gaussians() const {
  return tree ? tree->header().gaussians : cloud->size();
}

std::string RenderSetup::hash() const {
  return fmt::format("{:016x}", tree ? tree->header().checksum : scene_hash(*cloud));
}

const GaussianCloud& RenderSetup::whole_cloud(std::string_view flag) const {
  if (tree)
    throw InputError(flag, "", "needs all Gaussians in memory",
                     "leave --detail and --scene-memory out");
  return *cloud;
}

ScriptOptions script_options(const RenderOptions& options) {
  ScriptOptions script{.script = options.script};
  script.seed = options.seed.value_or(script.seed);
  script.duration_s = options.duration_s.value_or(script.duration_s);
  script.rate_hz = options.fps.value_or(script.rate_hz);
  return script;
}

void refuse_script_options(const RenderOptions& options) {
  const auto refuse = [](bool given, std::string_view flag) {
    if (!given) return;
    throw InputError(flag, "", "has no effect on a recorded trace", "it belongs to --script");
  };
  refuse(options.seed.has_value(), "--seed");
  refuse(options.duration_s.has_value(), "--duration");
}

RenderSetup prepare(const RenderOptions& options, bool quiet) {
  if (!options.trace.empty()) refuse_script_options(options);
  RenderSetup setup = prepare_scene(options, quiet);
  const std::vector<Lens> lenses = use_path(setup, options, make_path(options, setup.scene.hints));
  setup.lenses = make_lenses(options.lens, setup.scene.hints, path_file(options), lenses);
  setup.camera = setup.lenses.front();
  if (setup.lenses.size() == 1) setup.lenses.clear();
  return setup;
}

RenderSetup prepare_scene(const RenderOptions& options, bool quiet) {
  (void)make_lens(options.lens, {});  // a mistake appears before a large scene is read
  RendererOptions core = renderer_options(options);
  RenderSetup setup;
  setup.view = view_settings(options.pipeline);
  setup.predictor = predictor_settings(options.pipeline);
  if (options.in_pages()) {
    SceneInPages scene =
        open_in_pages(locate_scene(options.scene.path), options.scene, options.threads, quiet);
    setup.tree = std::move(scene.tree);
    setup.scene = std::move(scene.outline);
    setup.detail_px = options.detail_px.value_or(0.0f);
  } else {
    setup.scene = load_scene(options.scene, options.threads, quiet);
  }
  setup.cloud = std::make_shared<const GaussianCloud>(std::move(setup.scene.cloud));
  setup.camera = make_lens(options.lens, setup.scene.hints);
  setup.predictor.lever = forecast_lever(setup.camera.near_z);
  if (options.stereo) {
    const float metres = setup.scene.hints.about.metres_per_unit;
    setup.eye_distance =
        options.eye_distance.value_or(default_eye_distance_m / (metres > 0.0f ? metres : 1.0f));
  }
  setup.pool = std::make_shared<ThreadPool>(options.threads);
  core.pool = setup.pool;
  setup.made = setup.tree ? make_renderer(setup.tree, core) : make_renderer(setup.cloud, core);
  refuse_windows_without(*setup.made.renderer, options.pipeline);
  return setup;
}

void set_path(RenderSetup& setup, const RenderOptions& options) {
  RenderOptions poses_only = options;
  if (!options.lens.view_given()) poses_only.lens.fov_y_deg = default_fov_y_deg;
  (void)use_path(setup, poses_only, make_path(poses_only, setup.scene.hints));
}

RendererOptions renderer_options(const RenderOptions& options) {
  RendererOptions core;
  core.kind = parse_name<RendererKind>("--renderer", options.renderer,
                                       {{"auto", RendererKind::automatic},
                                        {"cpu", RendererKind::cpu},
                                        {"cuda", RendererKind::cuda},
                                        {"reference", RendererKind::reference}});
  core.simd = options.simd;
  if (options.scene_memory_gb)
    core.scene_memory = static_cast<std::uint64_t>(1e9 * *options.scene_memory_gb);
  if (!options.device.empty()) {
    try {
      core.devices = std::make_shared<DeviceSet>(parse_devices(options.device));
    } catch (const std::invalid_argument& error) {
      throw InputError("--device", "", error.what());
    }
  }
  check(core);
  return core;
}

FrameRange parse_frame_range(std::string_view text, std::size_t count) {
  FrameRange range{0, count};
  if (!text.empty()) {
    const std::size_t colon = std::min(text.find(':'), text.size());
    const std::string_view begin = text.substr(0, colon);
    const std::string_view end = text.substr(std::min(colon + 1, text.size()));
    if (colon == text.size() || (!begin.empty() && !parse_whole(begin, range.begin)) ||
        (!end.empty() && !parse_whole(end, range.end))) {
      throw InputError("--frames", "", fmt::format("\"{}\" is not a range", text),
                       "A:B, A: or :B, B not included");
    }
    range.end = std::min(range.end, count);
  }
  if (range.begin >= range.end) {
    throw InputError("--frames", "", fmt::format("\"{}\" selects nothing", text),
                     fmt::format("the path has {} frames", count));
  }
  return range;
}

void render_or_throw(View& view, const FrameRequest& request, FrameView& frame) {
  const RenderStatus status = view.render(request, frame);
  if (status.ok()) return;
  if (status.code == RenderStatus::Code::invalid_request) throw InputError("", "", status.message);
  throw std::runtime_error(status.message);
}

double reference_error(const RenderSetup& setup, std::size_t i, const FrameView& frame,
                       std::size_t count) {
  const auto pixels = random_pixels(frame.size_px, count, setup.first + i);
  const auto truth = render_reference_pixels(setup.whole_cloud("--pixels, --quality of exact"),
                                             setup.request(i), pixels, *setup.pool);
  double sum = 0.0;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    const auto* row = reinterpret_cast<const float*>(frame.planes[0].data +
                                                     frame.planes[0].stride_bytes *
                                                         static_cast<std::size_t>(pixels[k].y));
    for (int c = 0; c < 3; ++c) {
      const double error = static_cast<double>(row[pixels[k].x * 3 + c]) - truth[k][c];
      sum += error * error;
    }
  }
  return sum / static_cast<double>(3 * pixels.size());
}

}  // namespace catgs
