// catgs-render bench: the speed and the quality of a renderer along a camera path.
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/tools/bench/bench_report.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/json_report.h"
#include "render_core/tools/progress.h"

namespace catgs {
namespace {

struct BenchOptions {
  RenderOptions render;
  std::optional<std::size_t> warmup;
  std::size_t views = 1;
  bool quality = false;
  std::size_t quality_every = 10;
  std::string worst;
  std::string json;
};

void bench(const BenchOptions& options, bool quiet) {
  if (!options.worst.empty() && options.render.pipeline.pipeline == "exact") {
    throw InputError("--worst", "", "needs pictures of the exact pipeline to compare with",
                     "use --pipeline catgs or vanilla");
  }
  check_json(options.json);
  if (!options.worst.empty()) make_worst_frames_folder(options.worst);
  const RenderSetup setup = prepare(options.render, quiet);
  BenchResult result;
  result.settings = setup.view;
  result.warmup = warmup_frames(options.warmup, setup);
  result.views = options.views;
  {
    Progress progress("measuring", quiet);
    result.measurement = measure(
        setup, setup.view, result.warmup, [&](double fraction) { progress.update(fraction); },
        options.views);
  }
  result.pair_cost = count_pairs(setup, setup.view, result.measurement);
  if (options.quality) {
    Progress progress("judging", quiet);
    result.quality = judge(setup, setup.view, options.quality_every,
                           [&](double fraction) { progress.update(fraction); });
  }
  if (options.json != "-") print_report(setup, result);
  if (!options.json.empty()) write_json(options.json, report_json(options.render, setup, result));
  if (!options.worst.empty()) write_worst_frames(options.worst, *result.quality);
}

}  // namespace

void add_bench_command(CLI::App& app) {
  auto options = std::make_shared<BenchOptions>();
  CLI::App* command =
      app.add_subcommand("bench", "Measures how fast, and how well, a camera path renders");
  add_render_options(*command, options->render);
  add_stereo_options(*command, options->render);
  command->add_option("--warmup", options->warmup,
                      fmt::format("Frames rendered before measuring ({})", default_warmup));
  command
      ->add_option("--views", options->views,
                   "Views that render the path at the same time; the frame rate is their sum")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  auto* quality =
      command->add_flag("--quality", options->quality,
                        "Compare with the exact pipeline; compare exact with the reference");
  command
      ->add_option("--quality-every", options->quality_every,
                   "Judge one frame in N, and one step between frames in N; paper: to a key frame")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      ->add_option("--worst", options->worst,
                   "Write the worst key and sub-frames to this folder as PNG, with those of exact")
      ->needs(quality);
  command->add_option("--json", options->json,
                      "Write the report to this file; - prints it instead");
  command->callback([options, command] { bench(*options, is_quiet(*command)); });
}

}  // namespace catgs
