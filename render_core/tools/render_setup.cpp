#include "render_core/tools/render_setup.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "render_core/error.h"
#include "render_core/motion/anchor.h"
#include "render_core/tools/parse_name.h"
#include "render_core/tools/progress.h"

namespace catgs {
namespace {

constexpr float default_fov_y_deg = 60.0f;

RendererKind parse_renderer(std::string_view name) {
  return parse_name<RendererKind>("--renderer", name,
                                  {{"auto", RendererKind::automatic},
                                   {"cpu", RendererKind::cpu},
                                   {"cuda", RendererKind::cuda},
                                   {"reference", RendererKind::reference}});
}

template <typename T>
bool parse_whole(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

/// The camera's recorded or scripted samples.
Trajectory make_samples(const RenderOptions& options, const SceneHints& hints) {
  if (options.trace.empty() == options.script.script.empty()) {
    throw InputError("--trace, --script", "", "one of them is needed",
                     "--script orbit is a good start");
  }
  if (!options.script.script.empty()) {
    ScriptOptions script = options.script;
    script.rate_hz = options.fps.value_or(script.rate_hz);
    return make_script(script, hints);
  }
  const Trajectory trace = read_tum(options.trace);
  return options.anchor ? anchored(trace, hints) : trace;
}

double mean_rate_hz(const Trajectory& path) {
  if (path.size() < 2) return 1.0;
  return static_cast<double>(path.size() - 1) * 1e6 /
         static_cast<double>(path.back().time_us - path.front().time_us);
}

float focal_px_of(const RenderOptions& options, int height_px) {
  const float focal_px = options.focal_px.value_or(focal_from_fov_y(
      options.fov_y_deg.value_or(default_fov_y_deg) * std::numbers::pi_v<float> / 180.0f,
      height_px));
  if (!(std::isfinite(focal_px) && focal_px > 0.0f)) {
    throw InputError("--focal-px, --fov-deg", "", "the focal length must be positive",
                     "a field of view lies between 0 and 180 degrees");
  }
  return focal_px;
}

Scene load_with_progress(const RenderOptions& options, bool quiet) {
  Progress progress("loading", quiet);
  LoadOptions load;
  load.lod = options.lod;
  load.gaussian_budget = options.budget;
  load.threads = options.threads;
  load.progress = [&](double fraction) { progress.update(fraction); };
  return load_scene(options.scene, load);
}

}  // namespace

void add_render_options(CLI::App& command, RenderOptions& options) {
  command.add_option("scene", options.scene, "Scene file or folder")->required();
  auto* lod = command.add_option("--lod", options.lod,
                                 "Streamed SOG: this level of detail; 0 is the finest");
  command
      .add_option("--budget", options.budget,
                  "Streamed SOG: the finest levels with at most so many Gaussians")
      ->excludes(lod);
  auto* trace = command.add_option("--trace", options.trace, "Camera path: a TUM file");
  auto* script = command.add_option("--script", options.script.script,
                                    "Camera path: orbit, walk, head, drone, still or tour:FILE");
  trace->excludes(script);
  command.add_flag("--anchor", options.anchor, "Move the trace to the scene's start pose")
      ->needs(trace);
  command.add_option("--seed", options.script.seed, "Of the script")->capture_default_str();
  command.add_option("--duration", options.script.duration_s, "Of the script, seconds")
      ->capture_default_str();
  command.add_option("--fps", options.fps,
                     "Poses per second (default: a trace's own samples, 120 of a script)");
  command.add_option("--frames", options.frames, "A:B renders frames A to B - 1 of the path");
  command.add_option("--size", options.size, "Width x height, pixels")->capture_default_str();
  auto* focal = command.add_option("--focal-px", options.focal_px, "Focal length, pixels");
  command
      .add_option("--fov-deg", options.fov_y_deg,
                  fmt::format("Vertical field of view (default: {})", default_fov_y_deg))
      ->excludes(focal);
  command.add_option("--near", options.near_z,
                     "Near plane, world units (default: the scene's hint)");
  command.add_option("--renderer", options.renderer, "auto, cpu, cuda or reference")
      ->capture_default_str();
  add_pipeline_options(command, options.pipeline);
  command.add_option("--simd", options.simd, "CPU core: auto, scalar or a target's name")
      ->capture_default_str();
  command.add_option("--threads", options.threads, "0: one per core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

FrameRequest RenderSetup::request(std::size_t i) const {
  FrameRequest request;
  request.camera = camera;
  request.camera.world_from_camera = poses[i].world_from_camera;
  return request;
}

RenderSetup prepare(const RenderOptions& options, bool quiet) {
  const glm::ivec2 size_px = parse_size("--size", options.size);
  const float focal_px = focal_px_of(options, size_px.y);
  const RendererKind kind = parse_renderer(options.renderer);
  RenderSetup setup;
  setup.view = view_settings(options.pipeline);
  setup.scene = load_with_progress(options, quiet);
  setup.cloud = std::make_shared<const GaussianCloud>(std::move(setup.scene.cloud));
  setup.samples = make_samples(options, setup.scene.hints);
  const bool resampled = options.fps && !options.trace.empty();
  const Trajectory path = resampled ? resample(setup.samples, *options.fps) : setup.samples;
  const FrameRange range = parse_frame_range(options.frames, path.size());
  setup.first = range.begin;
  setup.poses.assign(path.begin() + static_cast<std::ptrdiff_t>(range.begin),
                     path.begin() + static_cast<std::ptrdiff_t>(range.end));
  setup.fps = options.fps.value_or(mean_rate_hz(path));
  setup.camera =
      make_camera({}, size_px, focal_px, options.near_z.value_or(setup.scene.hints.near_z));
  setup.pool = std::make_shared<ThreadPool>(options.threads);
  setup.made = make_renderer(setup.cloud, {.kind = kind, .pool = setup.pool, .simd = options.simd});
  return setup;
}

glm::ivec2 parse_size(std::string_view flag, std::string_view text) {
  const std::size_t cross = std::min(text.find('x'), text.size());
  glm::ivec2 size_px{0};
  const bool whole = cross < text.size() && parse_whole(text.substr(0, cross), size_px.x) &&
                     parse_whole(text.substr(cross + 1), size_px.y);
  if (!whole || std::min(size_px.x, size_px.y) < 1 ||
      std::max(size_px.x, size_px.y) > max_image_side_px) {
    throw InputError(flag, "", fmt::format("\"{}\" is not a picture size", text),
                     fmt::format("like 1280x720, sides of 1 to {}", max_image_side_px));
  }
  return size_px;
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

}  // namespace catgs
