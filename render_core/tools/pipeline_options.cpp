#include "render_core/tools/pipeline_options.h"

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/tools/parse_name.h"

namespace catgs {
namespace {

Pipeline parse_pipeline(std::string_view name) {
  return parse_name<Pipeline>("--pipeline", name,
                              {{"exact", Pipeline::exact},
                               {"vanilla", Pipeline::vanilla},
                               {"paper", Pipeline::paper},
                               {"catgs", Pipeline::catgs}});
}

BlendOrder parse_order(std::string_view name) {
  return parse_name<BlendOrder>("--order", name,
                                {{"fresh", BlendOrder::fresh}, {"key", BlendOrder::key}});
}

GridKind parse_grid(std::string_view name) {
  return parse_name<GridKind>(
      "--grid", name,
      {{"fixed", GridKind::fixed}, {"shift", GridKind::shift}, {"warp", GridKind::warp}});
}

/// Options without effect are refused, because they would spoil a comparison silently.
void refuse_without_caches(const PipelineOptions& options) {
  const auto refuse = [&](bool given, std::string_view flag) {
    if (!given) return;
    throw InputError(flag, "", fmt::format("has no effect on the {} pipeline", options.pipeline),
                     "use --pipeline catgs");
  };
  refuse(options.window.has_value(), "--window");
  refuse(options.max_trail_px.has_value(), "--max-trail-px");
  refuse(options.min_depth.has_value(), "--min-depth");
  refuse(options.max_deviation_px.has_value(), "--max-deviation-px");
  refuse(options.grid.has_value(), "--grid");
  refuse(options.guard_px.has_value(), "--guard-px");
  refuse(options.order.has_value(), "--order");
  refuse(options.no_cache, "--no-cache");
  refuse(options.no_colour_cache, "--no-colour-cache");
  refuse(options.constant_velocity, "--constant-velocity");
  refuse(options.cost_aware, "--cost-aware");
}

}  // namespace

void add_pipeline_options(CLI::App& command, PipelineOptions& options) {
  command
      .add_option("--pipeline", options.pipeline,
                  "exact, vanilla (the original 3DGS), paper (CaT-GS as published) or catgs (ours)")
      ->capture_default_str();
  add_speculation_options(command, options);
  command
      .add_flag("--no-cache", options.no_cache, "catgs: every frame is a key frame (--window 0)")
      ->excludes(command.get_option("--window"));
  command.add_flag("--no-colour-cache", options.no_colour_cache,
                   "catgs: shade every Gaussian in view in every frame");
  command.add_flag(
      "--cost-aware", options.cost_aware,
      "catgs: pause windows that cost more than they save, as the server does. The choice of "
      "key frames then depends on the machine");
  command.add_flag("--constant-velocity", options.constant_velocity,
                   "catgs: do not damp forecasts, however wrong earlier ones were");
  command.add_flag("--no-split", options.no_split,
                   "CUDA core: do not split long tile lists into slices");
}

void add_speculation_options(CLI::App& command, PipelineOptions& options) {
  const SpeculationSettings defaults;
  command.add_option(
      "--window", options.window,
      fmt::format(
          "catgs: sub-frames after a key frame while motion is small, within 100 ms; 0: none ({})",
          defaults.initial_window));
  command.add_option("--max-trail-px", options.max_trail_px,
                     fmt::format("catgs: largest motion of a Gaussian in a window, px ({})",
                                 defaults.max_trail_px));
  command.add_option(
      "--min-depth", options.min_depth,
      "catgs: depth below which Gaussians do not shorten the window (2 x near plane)");
  command.add_option(
      "--max-deviation-px", options.max_deviation_px,
      fmt::format("catgs: largest distance from the forecast, px, with the fixed or shift "
                  "grid; beyond it a key frame follows ({})",
                  defaults.max_deviation_px));
  command.add_option("--grid", options.grid,
                     "catgs: how tiles follow a turn of the camera: fixed, shift (by whole pixels) "
                     "or warp (warp)");
  command.add_option(
      "--guard-px", options.guard_px,
      fmt::format("catgs: widen lists by this many px for a camera that leaves its path, "
                  "with the warp grid ({})",
                  defaults.guard_px));
  command.add_option("--order", options.order,
                     "catgs: order in which sub-frames blend: by fresh depths or by those of the "
                     "key frame (fresh)");
}

ViewSettings view_settings(const PipelineOptions& options) {
  ViewSettings settings;
  settings.pipeline = parse_pipeline(options.pipeline);
  if (!keeps_caches(settings.pipeline)) refuse_without_caches(options);
  if (settings.pipeline == Pipeline::paper) {
    settings.speculation.grid = GridKind::fixed;
    settings.order = BlendOrder::key;
  }
  SpeculationSettings& speculation = settings.speculation;
  speculation.initial_window =
      options.no_cache ? 0 : options.window.value_or(speculation.initial_window);
  speculation.max_trail_px = options.max_trail_px.value_or(speculation.max_trail_px);
  speculation.min_depth = options.min_depth.value_or(speculation.min_depth);
  speculation.max_deviation_px = options.max_deviation_px.value_or(speculation.max_deviation_px);
  speculation.guard_px = options.guard_px.value_or(speculation.guard_px);
  if (options.grid) speculation.grid = parse_grid(*options.grid);
  const bool warps = speculation.grid == GridKind::warp;
  const auto refuse = [&](std::string_view flag, std::string_view remedy) {
    throw InputError(
        flag, "", fmt::format("has no effect on the {} grid", grid_name(speculation.grid)), remedy);
  };
  if (options.guard_px && !warps) refuse("--guard-px", "use --grid warp");
  if (options.max_deviation_px && warps) refuse("--max-deviation-px", "use --grid fixed or shift");
  check_speculation(speculation);
  if (options.order) settings.order = parse_order(*options.order);
  speculation.cost_aware = options.cost_aware;
  settings.colour_cache = !options.no_colour_cache;
  settings.split_tasks = !options.no_split;
  return settings;
}

PipelineOptions with_flags(PipelineOptions options, const std::string& flags) {
  const std::string_view catgs = pipeline_name(Pipeline::catgs);
  options.pipeline = catgs;
  CLI::App parser;
  add_pipeline_options(parser, options);
  try {
    parser.parse(flags);
  } catch (const CLI::ParseError& error) {
    throw InputError("--variant", flags, error.what(), "catgs-render bench --help lists the flags");
  }
  if (options.pipeline != catgs) {
    throw InputError("--variant", flags, "selects another pipeline than catgs",
                     "leave --pipeline out");
  }
  // Default flags of all rows apply only where they have an effect. The flags of this row decide.
  const bool warps = options.grid.value_or("warp") == "warp";
  if (!warps && parser.count("--guard-px") == 0) options.guard_px.reset();
  (void)view_settings(options);
  return options;
}

PredictorSettings predictor_settings(const PipelineOptions& options) {
  return {.min_confidence = options.constant_velocity ? 1.0 : 0.0};
}

std::string_view pipeline_name(Pipeline pipeline) {
  switch (pipeline) {
    case Pipeline::vanilla:
      return "vanilla";
    case Pipeline::exact:
      return "exact";
    case Pipeline::paper:
      return "paper";
    case Pipeline::catgs:
      break;
  }
  return "catgs";
}

std::string_view grid_name(GridKind grid) {
  switch (grid) {
    case GridKind::fixed:
      return "fixed";
    case GridKind::shift:
      return "shift";
    case GridKind::warp:
      break;
  }
  return "warp";
}

}  // namespace catgs
