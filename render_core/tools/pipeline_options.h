#pragma once

#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "render_core/motion/predictor.h"
#include "render_core/renderer.h"

namespace catgs {

/// The choice of pipeline and of its parts.
struct PipelineOptions {
  std::string pipeline = "exact";
  // For the catgs pipeline. Unset fields keep the default of ViewSettings.
  std::optional<int> window{};
  std::optional<float> max_trail_px{};
  std::optional<float> min_depth{};
  std::optional<float> max_deviation_px{};
  std::optional<std::string> grid{};
  std::optional<float> guard_px{};
  std::optional<std::string> order{};
  bool no_cache = false;
  bool cost_aware = false;
  bool no_colour_cache = false;
  bool constant_velocity = false;
  bool no_split = false;
};

/// The options belong to the caller and must outlive the command's callback.
void add_pipeline_options(CLI::App& command, PipelineOptions& options);
/// The options that adjust the catgs pipeline without leaving out a part.
void add_speculation_options(CLI::App& command, PipelineOptions& options);

/// Sets pipeline, speculation, order and task splitting from the options, the rest by default.
/// Throws InputError for an unknown name, a value out of range, or an option that the pipeline does
/// not have.
ViewSettings view_settings(const PipelineOptions& options);

/// The options of the catgs pipeline with additional flags, written as on a command line. Throws
/// InputError for what the command line would refuse; the error names --variant, where users give
/// such flags.
PipelineOptions with_flags(PipelineOptions options, const std::string& flags);

/// The predictor's settings for forecasts of the catgs pipeline.
PredictorSettings predictor_settings(const PipelineOptions& options);

std::string_view pipeline_name(Pipeline pipeline);
std::string_view grid_name(GridKind grid);

}  // namespace catgs
