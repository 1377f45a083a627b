#pragma once

#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "render_core/motion/predictor.h"
#include "render_core/renderer.h"

namespace catgs {

/// Which pipeline renders, and with which of its parts.
struct PipelineOptions {
  std::string pipeline = "exact";
  // Of the catgs pipeline; unset ones keep the default of ViewSettings.
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
/// Those of them that adjust the catgs pipeline without taking a part away.
void add_speculation_options(CLI::App& command, PipelineOptions& options);

/// Pipeline, speculation, order and task splitting of the options; the rest as by default. Throws
/// InputError for an unknown name, a value out of range, an option that the pipeline has not.
ViewSettings view_settings(const PipelineOptions& options);

/// The options of the catgs pipeline with these flags too, written as on a command line. InputError
/// for what that refuses; it names --variant, where users give such flags.
PipelineOptions with_flags(PipelineOptions options, const std::string& flags);

/// How the catgs pipeline's forecasts are made.
PredictorSettings predictor_settings(const PipelineOptions& options);

std::string_view pipeline_name(Pipeline pipeline);
std::string_view grid_name(GridKind grid);

}  // namespace catgs
