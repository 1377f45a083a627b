#include "render_core/tools/pipeline_options.h"

#include <algorithm>
#include <initializer_list>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/tools/parse_values.h"

namespace catgs {
namespace {

const std::initializer_list<std::pair<std::string_view, Pipeline>> pipelines = {
    {"exact", Pipeline::exact},
    {"vanilla", Pipeline::vanilla},
    {"paper", Pipeline::paper},
    {"catgs", Pipeline::catgs}};

void refuse_windows(const PipelineOptions& options, std::string_view where,
                    std::string_view remedy) {
  const auto refuse = [&](bool given, std::string_view flag) {
    if (given) throw InputError(flag, "", fmt::format("has no effect on {}", where), remedy);
  };
  refuse(options.window.has_value(), "--window");
  refuse(options.max_trail_px.has_value(), "--max-trail-px");
  refuse(options.min_depth.has_value(), "--min-depth");
  refuse(options.max_deviation_px.has_value(), "--max-deviation-px");
  refuse(options.no_cache, "--no-cache");
  refuse(options.constant_velocity, "--constant-velocity");
}

void refuse_without_colours(const PipelineOptions& options) {
  if (!options.no_colour_cache) return;
  throw InputError("--no-colour-cache", "",
                   fmt::format("has no effect on the {} pipeline", options.pipeline),
                   "use --pipeline catgs or paper");
}

}  // namespace

void add_pipeline_options(CLI::App& command, PipelineOptions& options) {
  command
      .add_option("--pipeline", options.pipeline,
                  "exact, vanilla (the original 3DGS), paper (CaT-GS as published) or catgs (ours)")
      ->capture_default_str();
  add_speculation_options(command, options);
  command
      .add_flag("--no-cache", options.no_cache,
                "paper, catgs: every frame is a key frame (--window 0)")
      ->excludes(command.get_option("--window"));
  command.add_flag("--no-colour-cache", options.no_colour_cache,
                   "catgs, paper, CPU core: shade every Gaussian in view in every frame");
  command.add_flag("--constant-velocity", options.constant_velocity,
                   "paper, catgs: do not damp forecasts, however wrong earlier ones were");
  command.add_flag("--no-split", options.no_split,
                   "CUDA core: do not split long tile lists into slices");
}

void add_speculation_options(CLI::App& command, PipelineOptions& options) {
  const SpeculationSettings defaults;
  command.add_option(
      "--window", options.window,
      fmt::format(
          "paper, catgs: sub-frames after a key frame while motion is small, within 100 ms; "
          "0: none (paper: {}, catgs: {} where that saves time)",
          defaults.initial_window, following_speculation.initial_window));
  command.add_option("--max-trail-px", options.max_trail_px,
                     fmt::format("paper, catgs: largest motion of a Gaussian in a window, px ({})",
                                 defaults.max_trail_px));
  command.add_option(
      "--min-depth", options.min_depth,
      "paper, catgs: depth below which Gaussians do not shorten the window (2 x near plane)");
  command.add_option(
      "--max-deviation-px", options.max_deviation_px,
      fmt::format("paper, catgs: largest distance from the forecast, px; beyond it a key frame "
                  "follows ({}, {})",
                  defaults.max_deviation_px, following_speculation.max_deviation_px));
}

ViewSettings view_settings(const PipelineOptions& options) {
  ViewSettings settings;
  settings.pipeline = parse_name("--pipeline", options.pipeline, pipelines);
  if (!has_groups(settings.pipeline))
    refuse_windows(options, fmt::format("the {} pipeline", options.pipeline),
                   "use --pipeline paper or catgs");
  if (!keeps_colours(settings.pipeline)) refuse_without_colours(options);
  SpeculationSettings& speculation = settings.speculation;
  if (settings.pipeline == Pipeline::catgs) speculation = following_speculation;
  speculation.where_it_pays = !options.window;
  speculation.initial_window =
      options.no_cache ? 0 : options.window.value_or(speculation.initial_window);
  speculation.max_trail_px = options.max_trail_px.value_or(speculation.max_trail_px);
  speculation.min_depth = options.min_depth.value_or(speculation.min_depth);
  speculation.max_deviation_px = options.max_deviation_px.value_or(speculation.max_deviation_px);
  check_speculation(speculation);
  settings.colour_cache = !options.no_colour_cache;
  settings.split_tasks = !options.no_split;
  return settings;
}

void refuse_windows_without(const Renderer& renderer, const PipelineOptions& options) {
  if (!renderer.has_windows(parse_name("--pipeline", options.pipeline, pipelines)))
    refuse_windows(options, fmt::format("the {} pipeline of this core", options.pipeline),
                   "use --renderer cuda, or --pipeline paper");
}

PipelineOptions with_flags(PipelineOptions options, const std::string& flags) {
  const std::string pipeline = options.pipeline;
  CLI::App parser;
  add_pipeline_options(parser, options);
  try {
    parser.parse(flags);
  } catch (const CLI::ParseError& error) {
    throw InputError("--variant", flags, error.what(), "catgs-render bench --help lists the flags");
  }
  if (options.pipeline != pipeline) {
    throw InputError("--variant", flags, "selects another pipeline than " + pipeline,
                     "leave --pipeline out");
  }
  (void)view_settings(options);
  return options;
}

PredictorSettings predictor_settings(const PipelineOptions& options) {
  return {.min_confidence = options.constant_velocity ? 1.0 : 0.0};
}

std::string_view pipeline_name(Pipeline pipeline) {
  return std::ranges::find(pipelines, pipeline, [](const auto& known) { return known.second; })
      ->first;
}

}  // namespace catgs
