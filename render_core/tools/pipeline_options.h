#pragma once

#include <optional>
#include <string>

#include "render_core/base/cli_fwd.h"
#include "render_core/frame/renderer.h"
#include "render_core/motion/predictor.h"

namespace catgs {

/// The choice of pipeline and of its parts.
struct PipelineOptions {
  std::string pipeline = "exact";
  // For the paper's pipeline, down to no_cache, and constant_velocity. Unset fields keep the
  // default of ViewSettings.
  std::optional<int> window{};
  std::optional<float> max_trail_px{};
  std::optional<float> min_depth{};
  std::optional<float> max_deviation_px{};
  bool no_cache = false;
  bool no_colour_cache = false;
  bool constant_velocity = false;
  bool no_split = false;
};

/// The options belong to the caller and must outlive the command's callback.
void add_pipeline_options(CLI::App& command, PipelineOptions& options);
/// The options that adjust the paper's pipeline without leaving out a part.
void add_speculation_options(CLI::App& command, PipelineOptions& options);

/// Sets pipeline, speculation and task splitting from the options, the rest by default.
/// Throws InputError for an unknown name, a value out of range, or an option that the pipeline does
/// not have.
ViewSettings view_settings(const PipelineOptions& options);

/// Throws InputError for an option of windows that Views of this renderer do not have.
void refuse_windows_without(const Renderer& renderer, const PipelineOptions& options);

/// The options with additional flags for their pipeline, written as on a command line. Throws
/// InputError for what the command line would refuse; the error names --variant, where users give
/// such flags.
PipelineOptions with_flags(PipelineOptions options, const std::string& flags);

/// The predictor's settings for forecasts of the paper's pipeline.
PredictorSettings predictor_settings(const PipelineOptions& options);

std::string_view pipeline_name(Pipeline pipeline);

}  // namespace catgs
