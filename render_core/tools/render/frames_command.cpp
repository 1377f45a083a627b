// catgs-render frames: a camera path as pictures or video.
#include <chrono>
#include <memory>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/metrics/image_quality.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/frame_feed.h"
#include "render_core/tools/progress.h"
#include "render_core/tools/reference_check.h"
#include "render_core/tools/render/frame_sink.h"
#include "render_core/tools/render_setup.h"

namespace catgs {
namespace {

struct FramesOptions {
  RenderOptions render;
  std::string out;
  std::size_t checked_pixels = 0;
};

std::unique_ptr<FrameSink> make_sink(const FramesOptions& options, const RenderSetup& setup) {
  if (options.out.empty()) {
    if (options.checked_pixels > 0) return nullptr;
    throw InputError("--out", "", "is missing", "a folder, or a file .png, .y4m or .mp4");
  }
  auto sink = make_frame_sink({.path = options.out,
                               .size_px = setup.camera.size_px,
                               .fps = setup.fps,
                               .first_frame = setup.first});
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
  const RenderSetup setup = prepare(options.render, quiet);
  const auto sink = make_sink(options, setup);
  ViewSettings settings = setup.view;
  settings.format = sink ? sink->format() : PixelFormat::rgb_f32;
  const auto view = setup.made.renderer->make_view(settings);
  FrameFeed feed(setup, settings);
  if (!quiet) {
    fmt::print(stderr, "{} ({})\n", setup.made.renderer->description(), setup.made.reason);
  }
  double error_sum = 0.0;
  {
    Progress progress("rendering", quiet);
    for (std::size_t i = 0; i < setup.poses.size(); ++i) {
      FrameView frame;
      render_or_throw(*view, feed.next(), frame);
      if (sink) sink->write(frame);
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
  command->add_option("--out", options->out, "A folder of PNG files, or a .png, .y4m or .mp4 file");
  command->add_option("--pixels", options->checked_pixels,
                      "Also print the PSNR against the reference at this many random pixels");
  command->callback([options, command] { render_frames(*options, is_quiet(*command)); });
}

}  // namespace catgs
