// catgs-render frames: a camera path as pictures or video.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/image/host_image.h"
#include "render_core/image/panorama.h"
#include "render_core/image/png.h"
#include "render_core/metrics/image_quality.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/frame_feed.h"
#include "render_core/tools/progress.h"
#include "render_core/tools/render/frame_layers.h"
#include "render_core/tools/render/frame_sink.h"
#include "render_core/tools/render_setup.h"

namespace catgs {
namespace {

constexpr double default_fps = 30.0;                // of scripts, and of videos at most
constexpr const char* panorama_size = "4096x2048";  // unless another is asked for

struct FramesOptions {
  RenderOptions render;
  std::string out;
  std::string background = "black";
  bool alpha = false, depth = false, panorama = false;
  std::size_t checked_pixels = 0;
};

glm::vec3 parse_colour(std::string_view flag, std::string_view text) {
  if (text == "black") return glm::vec3(0.0f);
  if (text == "white") return glm::vec3(1.0f);
  const auto rgb = parse_rgb(text.substr(text.starts_with('#') ? 1 : 0));
  if (!rgb)
    throw InputError(flag, "", fmt::format("\"{}\" is not a colour", text),
                     "white, black or six hexadecimal digits like ff8000");
  return colour_of(*rgb);
}

bool is_still(const Trajectory& poses) {
  const Pose& first = poses.front().world_from_camera;
  return std::ranges::all_of(poses, [&](const TimedPose& pose) {
    return pose.world_from_camera.position == first.position &&
           pose.world_from_camera.orientation == first.orientation;
  });
}

/// Scene and path, with the defaults of pictures and videos.
RenderSetup prepare_frames(const FramesOptions& options, bool quiet) {
  RenderOptions render = options.render;
  const glm::vec3 background = parse_colour("--background", options.background);
  if (!render.fps && !render.script.empty()) render.fps = default_fps;
  if (options.panorama) {
    render.lens.fov_y_deg = 90.0f;  // its sides have a lens of their own
    if (!render.lens.size_given) render.lens.size = panorama_size;
    render.lens.size_given = true;
  }
  if (is_video(options.out)) render.most_fps = default_fps;
  std::error_code error;
  if (render.trace.empty() && render.script.empty() &&
      std::filesystem::exists(render.scene.path, error)) {
    const auto test_views = locate_scene(render.scene.path).hints.test_views;
    if (std::filesystem::exists(test_views, error)) render.trace = test_views.string();
  }
  RenderSetup setup = prepare(render, quiet);
  setup.background = background;
  // One picture shows all that a camera at rest sees, unless a length was asked for.
  const bool one_lens = setup.names.empty() && setup.lenses.empty();
  if (one_lens && render.frames.empty() && !render.duration_s && is_still(setup.poses))
    setup.poses.resize(1);
  return setup;
}

/// The panorama from where `request` looks, which is levelled, as a frame that `image` holds.
FrameView draw_panorama(const RenderSetup& setup, FrameRequest& request, View& view,
                        HostImage& image) {
  Pose& pose = request.camera.world_from_camera;
  pose = levelled(pose, setup.scene.hints.up);
  const Image panorama =
      draw_panorama(request, request.camera.size_px, *setup.pool, [&](const FrameRequest& of_side) {
        FrameView frame;
        render_or_throw(view, of_side, frame);
        return copy_image(frame);
      });
  image.resize(PixelFormat::rgb_f32, panorama.size_px);
  for (int y = 0; y < panorama.size_px.y; ++y)
    std::copy_n(panorama.row(y), 3 * panorama.size_px.x, image.rgb_row(y));
  return {PixelFormat::rgb_f32, MemorySpace::host, panorama.size_px, image.planes(), {}};
}

void check_panorama(const FramesOptions& options, glm::ivec2 size_px) {
  if (is_video(options.out))
    throw InputError("--panorama", "", "makes pictures, no videos", "give a folder or a .png file");
  if (size_px.x != 2 * size_px.y)
    throw InputError("--size", "", "a panorama is twice as wide as high", "like 8192x4096");
}

std::unique_ptr<FrameSink> make_sink(const FramesOptions& options, const RenderSetup& setup) {
  if (options.out.empty()) {
    if (options.checked_pixels > 0) return nullptr;
    throw InputError("--out", "", "is missing", "a folder, or a file .png, .y4m or .mp4");
  }
  const auto [names, problem] = picture_names(setup.names);
  const bool is_folder = !options.out.ends_with(".png") && !is_video(options.out);
  const bool has_names = std::ranges::any_of(setup.names, [](const auto& n) { return !n.empty(); });
  if (is_folder && has_names && !problem.empty())
    fmt::print(stderr, "note: pictures have frame numbers, since {}\n", problem);
  auto sink = make_frame_sink({.path = options.out,
                               .size_px = setup.picture_px(),
                               .fps = setup.fps,
                               .first_frame = setup.first,
                               .names = names,
                               .origin = setup.scene.hints.origin,
                               .tells_cameras = !setup.eye_distance,
                               .layers = options.alpha || options.depth});
  if (options.out.ends_with(".png") && setup.poses.size() != 1) {
    throw InputError(options.out, "", fmt::format("one picture for {} frames", setup.poses.size()),
                     "choose one with --frames A:A+1, or give a folder");
  }
  if (options.checked_pixels > 0 && sink->format() != PixelFormat::rgb_f32) {
    throw InputError("--pixels", "", "compares RGB, which a video does not have",
                     "write PNG pictures");
  }
  return sink;
}

void render_frames(const FramesOptions& options, bool quiet) {
  const RenderSetup setup = prepare_frames(options, quiet);
  if (options.panorama) check_panorama(options, setup.camera.size_px);
  const auto sink = make_sink(options, setup);
  ViewSettings settings = setup.view;
  settings.format = sink ? sink->format() : PixelFormat::rgb_f32;
  const auto view = setup.made.renderer->make_view(settings);
  FrameFeed feed(setup, settings);
  std::optional<LayerRenderer> layers;
  if (sink && (options.alpha || options.depth))
    layers.emplace(setup.whole_cloud("--alpha, --depth"), options.alpha, options.depth, setup.pool);
  if (!quiet) {
    fmt::print(stderr, "{} ({})\n", setup.made.renderer->description(), setup.made.reason);
  }
  double error_sum = 0.0;
  HostImage panorama;
  {
    Progress progress("rendering", quiet);
    for (std::size_t i = 0; i < setup.poses.size(); ++i) {
      FrameView frame;
      FrameRequest request = feed.next();
      if (options.panorama)
        frame = draw_panorama(setup, request, *view, panorama);
      else
        render_or_throw(*view, request, frame);
      if (sink)
        sink->write(frame, layers ? layers->render(request.camera) : FrameLayers{}, request.camera);
      if (options.checked_pixels > 0) {
        const double error = reference_error(setup, i, frame, options.checked_pixels);
        fmt::print("frame {:6}  {:7.2f} dB against the reference\n", setup.first + i,
                   psnr_db(error));
        error_sum += error;
      }
      progress.update(static_cast<double>(i + 1) / static_cast<double>(setup.poses.size()));
    }
  }
  if (sink) sink->finish();
  if (options.checked_pixels > 0) {
    fmt::print("all frames    {:7.2f} dB against the reference\n",
               psnr_db(error_sum / static_cast<double>(setup.poses.size())));
  }
}

}  // namespace

void add_frames_command(CLI::App& app) {
  auto options = std::make_shared<FramesOptions>();
  CLI::App* command = app.add_subcommand("frames", "Renders a camera path to pictures or a video");
  add_render_options(*command, options->render);
  add_stereo_options(*command, options->render);
  command->add_option("--out", options->out,
                      "A folder of PNG files, or a .png, .y4m or .mp4 file. In a folder, pictures "
                      "have the names that the path's file gives them, else numbers");
  auto* background =
      command
          ->add_option("--background", options->background,
                       "Colour behind the scene: black, white or six hexadecimal digits (RRGGBB)")
          ->capture_default_str();
  auto* alpha = command->add_flag("--alpha", options->alpha, "Pictures get an alpha channel")
                    ->excludes(background);
  auto* depth = command->add_flag(
      "--depth", options->depth,
      "Write a NumPy file beside each picture: mean depth along the view axis, world "
      "units, 0 where nothing is seen");
  command
      ->add_flag("--panorama", options->panorama,
                 fmt::format("Upright pictures of all around, equirectangular. Their --size is {} "
                             "by default",
                             panorama_size))
      ->excludes(alpha)
      ->excludes(depth)
      ->excludes(command->get_option("--stereo"))
      ->excludes(command->get_option("--fov-deg"))
      ->excludes(command->get_option("--focal-px"))
      ->excludes(command->get_option("--orthographic"));
  for (auto* layer : {alpha, depth}) layer->excludes(command->get_option("--stereo"));
  command->get_option("--fps")->description(
      "Frames per second (default: 30 for a script, else the rate of the trace, of which a video "
      "gets 30 at most). The trace is resampled, but forecasts use its recorded samples only, and "
      "none of the future");
  command->footer(
      "A path that stands still is one frame, unless --duration or --frames is given. Without a "
      "path, the views of a transforms_test.json beside the scene are drawn.");
  command
      ->add_option("--pixels", options->checked_pixels,
                   "Also print the PSNR against the reference at this many random pixels")
      ->excludes("--panorama");
  command->callback([options, command] { render_frames(*options, is_quiet(*command)); });
}

}  // namespace catgs
