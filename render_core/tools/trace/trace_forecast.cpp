// catgs-render trace forecast: compares ways to predict recorded camera motion.
#include <algorithm>
#include <charconv>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/metrics/summary.h"
#include "render_core/motion/camera_path.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/json_report.h"
#include "render_core/tools/progress.h"
#include "render_core/tools/scene_options.h"
#include "render_core/tools/table.h"
#include "render_core/tools/trace/forecast_trial.h"

namespace catgs {
namespace {

struct ForecastOptions {
  std::vector<std::string> traces;
  std::vector<std::string> inputs{"native", "60", "120"};
  double jitter_ms = 20.0;
  std::uint64_t seed = 1;
  std::string size = "1920x1080";
  float focal_px = 1100.0f;
  std::string json;
};

/// Parses a rate; "native" is 0.
double parse_input_hz(const std::string& text) {
  if (text == "native") return 0.0;
  double rate_hz = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), rate_hz);
  if (error != std::errc() || end != text.data() + text.size() ||
      !(rate_hz >= 1.0 && rate_hz <= 1000.0)) {
    throw InputError("--input", "", fmt::format("\"{}\" is not a rate", text),
                     "native, or 1 to 1000 Hz");
  }
  return rate_hz;
}

std::vector<Trajectory> read_traces(const std::vector<std::string>& files) {
  std::vector<Trajectory> traces;
  for (const std::string& file : files) {
    traces.push_back(read_camera_path(file).poses);
    if (traces.back().back().time_us - traces.back().front().time_us < 1'000'000) {
      throw InputError(file, "", "is shorter than a second", "half of it only shows the motion");
    }
  }
  return traces;
}

/// [model][horizon], over all traces.
using Errors = std::vector<std::vector<ForecastErrors>>;

Errors judge_models(const std::vector<ForecastModel>& models, const std::vector<Trajectory>& traces,
                    const ForecastTrial& trial, const Camera& lens, Progress& progress) {
  Errors all(models.size(), std::vector<ForecastErrors>(trial.horizons_us.size()));
  ThreadPool pool;
  for (std::size_t t = 0; t < traces.size(); ++t) {
    ForecastTrial with_seed = trial;
    with_seed.seed += t;
    pool.parallel_for(models.size(), [&](std::size_t m) {
      const auto errors = judge_forecasts(traces[t], with_seed, lens, models[m]);
      for (std::size_t h = 0; h < errors.size(); ++h) {
        ForecastErrors& sum = all[m][h];
        sum.px.insert(sum.px.end(), errors[h].px.begin(), errors[h].px.end());
        sum.deg.insert(sum.deg.end(), errors[h].deg.begin(), errors[h].deg.end());
      }
    });
    progress.update(static_cast<double>(t + 1) / static_cast<double>(traces.size()));
  }
  return all;
}

PaperTable error_table(std::string title, const std::vector<ForecastModel>& models,
                       const ForecastTrial& trial, const Errors& errors,
                       std::vector<double> ForecastErrors::*which, int decimals) {
  PaperTable table;
  table.title = std::move(title);
  for (const std::int64_t horizon_us : trial.horizons_us) {
    table.columns.push_back(fmt::format("{} ms", horizon_us / 1000));
    table.columns.push_back(fmt::format("p95 at {} ms", horizon_us / 1000));
  }
  for (std::size_t m = 0; m < models.size(); ++m) {
    PaperTable::Row row{models[m].name, {}};
    for (const ForecastErrors& at_horizon : errors[m]) {
      const Summary summary = summarize(at_horizon.*which);
      row.numbers.push_back({summary.mean, decimals});
      row.numbers.push_back({summary.p95, decimals});
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

void forecast(const ForecastOptions& options, bool quiet) {
  const Camera lens = make_camera({}, parse_size("--size", options.size), options.focal_px);
  std::vector<double> inputs_hz;
  for (const std::string& input : options.inputs) inputs_hz.push_back(parse_input_hz(input));
  const std::vector<Trajectory> traces = read_traces(options.traces);
  check_json(options.json);
  const std::vector<ForecastModel> models = forecast_models();
  nlohmann::ordered_json report{{"traces", options.traces},     {"jitter_ms", options.jitter_ms},
                                {"seed", options.seed},         {"size", options.size},
                                {"focal_px", options.focal_px}, {"tables", nullptr}};
  for (std::size_t i = 0; i < inputs_hz.size(); ++i) {
    ForecastTrial trial{.input_hz = inputs_hz[i], .jitter_ms = options.jitter_ms};
    trial.seed = options.seed;
    const std::string input =
        inputs_hz[i] > 0.0 ? fmt::format("{} Hz", options.inputs[i]) : "Native samples";
    Errors errors;
    {
      Progress progress(input, quiet);
      errors = judge_models(models, traces, trial, lens, progress);
    }
    const std::array<PaperTable, 2> tables = {
        error_table(input + ": error in pixels", models, trial, errors, &ForecastErrors::px, 2),
        error_table(input + ": error in degrees", models, trial, errors, &ForecastErrors::deg, 3)};
    for (const PaperTable& table : tables) {
      if (options.json != "-") fmt::print("{}\n", markdown(table));
      report["tables"].push_back(to_json(table));
    }
  }
  if (!options.json.empty()) write_json(options.json, report);
}

}  // namespace

void add_trace_forecast_command(CLI::App& trace) {
  auto options = std::make_shared<ForecastOptions>();
  CLI::App* command = trace.add_subcommand(
      "forecast", "Compares ways to predict a camera on recorded traces, as Markdown");
  command->add_option("--trace", options->traces, "Camera paths of recorded motion")->required();
  command
      ->add_option("--input", options->inputs,
                   "Rate at which a client sends its newest sample, Hz, or native")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  command->add_option("--jitter-ms", options->jitter_ms, "Samples arrive up to this much later")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Of the jitter")->capture_default_str();
  command->add_option("--size", options->size, "Size of the picture in which errors count, pixels")
      ->capture_default_str();
  command->add_option("--focal-px", options->focal_px, "Its focal length, pixels")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--json", options->json,
                      "Also write the tables to this file; - prints JSON instead");
  command->callback([options, command] { forecast(*options, is_quiet(*command)); });
}

}  // namespace catgs
