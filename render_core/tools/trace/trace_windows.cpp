// catgs-render trace windows: the length of key frames' windows on recorded motion, by the rules of
// motion/frame_groups.h alone. Needs no scene and draws nothing.
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/motion/camera_path.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/frame_feed.h"
#include "render_core/tools/json_report.h"
#include "render_core/tools/pipeline_options.h"
#include "render_core/tools/progress.h"
#include "render_core/tools/scene_options.h"
#include "render_core/tools/table.h"

namespace catgs {
namespace {

struct WindowsOptions {
  std::vector<std::string> traces;
  std::vector<double> rates_hz{120.0, 60.0, 30.0};
  float nearest_depth = 1.0f;  // in every frame, world units
  LensOptions lens{.size = "1920x1080", .focal_px = 1100.0f, .fov_y_deg = {}, .near_z = 0.2f};
  PipelineOptions pipeline{.pipeline = "paper"};
  std::vector<std::string> variants;
  std::string json;
};

/// A way to choose key frames, as flags of `bench`.
struct Rule {
  std::string name, flags;
};

std::vector<Rule> rules(const WindowsOptions& options) {
  std::vector<Rule> all = {
      {"The paper's rule", "--max-deviation-px 1e9"},  // right or wrong
      {"Ended off the forecast", ""},
      {"The same, W0 = 8", "--window 8"},
  };
  for (const std::string& flags : options.variants) all.push_back({flags, flags});
  return all;
}

/// Numbers of frames of each kind, over all traces.
struct Groups {
  std::size_t frames = 0, keys = 0, keys_without_window = 0;
};

/// A trace at a frame rate, without a scene, for FrameFeed: forecasts know the recorded samples up
/// to each frame.
RenderSetup make_journey(const Trajectory& trace, double rate_hz, const WindowsOptions& options,
                         const PipelineOptions& pipeline) {
  RenderSetup setup;
  setup.samples = trace;
  setup.poses = resample(trace, rate_hz);
  setup.fps = rate_hz;
  setup.camera = make_lens(options.lens, {});
  setup.predictor = predictor_settings(pipeline);
  setup.predictor.lever = forecast_lever(setup.camera.near_z);
  setup.view = view_settings(pipeline);
  return setup;
}

/// Counts groups as a View makes them: a key frame is made and shown where a group has ended.
void add_groups(const RenderSetup& setup, float nearest_depth, Groups& sum) {
  FrameFeed feed(setup, setup.view);
  FrameGroups groups(setup.view.speculation);
  for (std::size_t i = 0; i < setup.poses.size(); ++i) {
    const FrameRequest request = feed.next();
    const FramePlan plan = groups.plan(request.camera, request.forecast, nearest_depth);
    ++sum.frames;
    if (plan.kind == FrameKind::sub) continue;
    ++sum.keys;
    sum.keys_without_window += plan.window == 0 ? 1 : 0;
  }
}

PaperTable windows_table(const WindowsOptions& options, const std::vector<Trajectory>& traces,
                         const std::vector<Rule>& all_rules, Progress& progress) {
  PaperTable table{
      .corner = "Frames per key frame",
      .notes = {fmt::format("No window: share of the key frames. {} traces, {} at {:g} px, nearest "
                            "depth {:g}.",
                            traces.size(), options.lens.size, *options.lens.focal_px,
                            options.nearest_depth)}};
  for (const double rate_hz : options.rates_hz) {
    table.columns.push_back(fmt::format("{:g} Hz", rate_hz));
    table.columns.push_back(fmt::format("no window, {:g} Hz", rate_hz));
  }
  for (const Rule& rule : all_rules) {
    const PipelineOptions pipeline = with_flags(options.pipeline, rule.flags);
    PaperTable::Row& row = table.rows.emplace_back(PaperTable::Row{rule.name});
    for (const double rate_hz : options.rates_hz) {
      Groups sum;
      for (const Trajectory& trace : traces) {
        add_groups(make_journey(trace, rate_hz, options, pipeline), options.nearest_depth, sum);
      }
      const auto keys = static_cast<double>(sum.keys);
      row.numbers.push_back({static_cast<double>(sum.frames) / keys, 2});
      row.numbers.push_back({100.0 * static_cast<double>(sum.keys_without_window) / keys, 0, " %"});
    }
    progress.update(static_cast<double>(table.rows.size()) / static_cast<double>(all_rules.size()));
  }
  return table;
}

void windows(const WindowsOptions& options, bool quiet) {
  (void)make_lens(options.lens, {});
  const std::vector<Rule> all_rules = rules(options);
  for (const Rule& rule : all_rules) (void)with_flags(options.pipeline, rule.flags);
  std::vector<Trajectory> traces;
  for (const std::string& file : options.traces) traces.push_back(read_camera_path(file).poses);
  check_json(options.json);
  PaperTable table;
  {
    Progress progress("windows", quiet);
    table = windows_table(options, traces, all_rules, progress);
  }
  if (options.json != "-") fmt::print("{}", markdown(table));
  if (options.json.empty()) return;
  nlohmann::ordered_json flags;
  for (const Rule& rule : all_rules) flags[rule.name] = rule.flags;
  write_json(options.json, {{"traces", options.traces},
                            {"size", options.lens.size},
                            {"focal_px", *options.lens.focal_px},
                            {"near", *options.lens.near_z},
                            {"nearest_depth", options.nearest_depth},
                            {"flags", flags},
                            {"table", to_json(table)}});
}

}  // namespace

void add_trace_windows_command(CLI::App& trace) {
  auto options = std::make_shared<WindowsOptions>();
  CLI::App* command = trace.add_subcommand(
      "windows", "Prints frames per key frame and lost windows for each rule, as Markdown");
  command->add_option("--trace", options->traces, "Camera paths of recorded motion")->required();
  command->add_option("--fps", options->rates_hz, "Frames per second; one or more")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--nearest-depth", options->nearest_depth,
                   "Depth of the nearest Gaussian in every frame, world units")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--size", options->lens.size, "Size of the picture, pixels")
      ->capture_default_str();
  command->add_option("--focal-px", options->lens.focal_px, "Focal length, pixels")
      ->check(CLI::PositiveNumber)
      ->default_str("1100");
  command->add_option("--near", options->lens.near_z, "Near plane, world units")
      ->check(CLI::PositiveNumber)
      ->default_str("0.2");
  add_speculation_options(*command, options->pipeline);
  command
      ->add_option("--variant", options->variants,
                   "Add a row for these flags of bench, like \"--window 16 --constant-velocity\"")
      ->allow_extra_args(false);
  command->add_option("--json", options->json,
                      "Also write the table to this file; - prints JSON instead");
  command->callback([options, command] { windows(*options, is_quiet(*command)); });
}

}  // namespace catgs
