// catgs-render bench: how fast a camera path renders, and how well.
#include <cstdio>
#include <fstream>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/build_info.h"
#include "render_core/error.h"
#include "render_core/metrics/summary.h"
#include "render_core/tools/bench_measure.h"
#include "render_core/tools/bench_quality.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/progress.h"
#include "render_core/tools/render_setup.h"
#include "render_core/tools/scene_hash.h"

namespace catgs {
namespace {

using Json = nlohmann::ordered_json;

struct BenchOptions {
  RenderOptions render;
  std::size_t warmup = 10;
  bool quality = false;
  std::size_t quality_every = 10;
  std::string json;
};

struct BenchResult {
  Measurement measurement;
  PairCost pair_cost;
  std::optional<QualityReport> quality;

  /// Everything before the blend, over the Gaussians of the scene.
  [[nodiscard]] double ns_per_gaussian(const RenderSetup& setup) const {
    const double ms = measurement.mean_stage_ms(Stage::project) +
                      measurement.mean_stage_ms(Stage::bin) +
                      measurement.mean_stage_ms(Stage::sort);
    return 1e6 * ms / static_cast<double>(std::max<std::size_t>(setup.cloud->size(), 1));
  }
};

struct ListLength {
  double mean = 0.0;             // list entries per frame
  std::uint64_t max = 0;         // of a frame
  std::uint32_t tile_max = 0;    // longest list of a tile
  std::uint64_t overflowed = 0;  // entries that found no memory, all frames
  double visible_mean = 0.0;
};

ListLength list_length(const Measurement& measurement) {
  ListLength length;
  const auto count = static_cast<double>(measurement.frames.size());
  for (const Measurement::Frame& frame : measurement.frames) {
    length.mean += static_cast<double>(frame.stats.list_entries) / count;
    length.visible_mean += static_cast<double>(frame.stats.visible) / count;
    length.max = std::max(length.max, frame.stats.list_entries);
    length.tile_max = std::max(length.tile_max, frame.stats.list_max);
    length.overflowed += frame.stats.overflowed_entries;
  }
  return length;
}

Json to_json(const Summary& summary) {
  if (summary.count == 0) return nullptr;
  return {{"mean", summary.mean},
          {"p50", summary.p50},
          {"p95", summary.p95},
          {"p99", summary.p99},
          {"max", summary.max}};
}

/// JSON has no infinity: null stands for the PSNR of identical pictures.
Json to_json(const QualityTally& tally, bool whole_images) {
  if (tally.frames() == 0) return nullptr;
  Json json = {{"frames", tally.frames()},
               {"psnr_db", {{"mean", tally.mean_psnr()}, {"min", tally.min_psnr()}}}};
  if (whole_images) {
    json["ssim"] = {{"mean", tally.mean_ssim()}, {"min", tally.min_ssim()}};
    json["worst_block_psnr_db"] = tally.worst_block_psnr();
    json["block_0_1_percent_psnr_db"] = tally.block_0_1_percent_psnr();
  }
  return json;
}

Json settings_json(const BenchOptions& options, const RenderSetup& setup) {
  const RenderOptions& render = options.render;
  Json json;
  if (render.trace.empty()) {
    json["script"] = render.script.script;
    json["seed"] = render.script.seed;
  } else {
    json["trace"] = render.trace;
    json["anchor"] = render.anchor;
  }
  json["fps"] = setup.fps;
  json["frames"] = {setup.first, setup.first + setup.poses.size()};
  json["size_px"] = {setup.camera.size_px.x, setup.camera.size_px.y};
  json["focal_px"] = setup.camera.focal_px.x;
  json["near"] = setup.camera.near_z;
  json["pipeline"] = render.pipeline;
  json["simd"] = render.simd;
  json["threads"] = setup.pool->threads();
  json["warmup"] = options.warmup;
  return json;
}

Json report_json(const BenchOptions& options, const RenderSetup& setup, const BenchResult& result) {
  const Measurement& measurement = result.measurement;
  const ListLength lists = list_length(measurement);
  const std::vector<double> key_ms = measurement.frame_ms(FrameKind::key);
  const std::vector<double> sub_ms = measurement.frame_ms(FrameKind::sub);
  Json stages;
  for (std::size_t i = 0; i < stage_count; ++i) {
    stages[std::string(stage_names[i])] = measurement.mean_stage_ms(static_cast<Stage>(i));
  }
  Json json = {
      {"version", build_version},
      {"commit", build_commit},
      {"device", setup.made.renderer->description()},
      {"device_reason", setup.made.reason},
      {"scene",
       {{"name", setup.scene.name},
        {"format", setup.scene.format},
        {"gaussians", setup.cloud->size()},
        {"sh_degree", setup.cloud->sh_degree},
        {"hash", fmt::format("{:016x}", scene_hash(*setup.cloud))}}},
      {"settings", settings_json(options, setup)},
      {"fps_mean", measurement.fps()},
      {"frame_ms", to_json(summarize(measurement.frame_ms()))},
      {"frame_ms_key", to_json(summarize(key_ms))},
      {"frame_ms_sub", to_json(summarize(sub_ms))},
      {"flatness", flatness(measurement.frame_ms())},
      {"stage_ms", stages},
      {"visible_mean", lists.visible_mean},
      {"list_length", {{"mean", lists.mean}, {"max", lists.max}, {"tile_max", lists.tile_max}}},
      {"overflowed_entries", lists.overflowed},
      {"key_frames", key_ms.size()},
      {"sub_frames", sub_ms.size()},
      {"window_histogram", Json::object()},
      {"ns_per_gaussian", result.ns_per_gaussian(setup)},
      {"ns_per_blended_pair", result.pair_cost.ns_per_pair},
      {"blended_pairs_mean", result.pair_cost.pairs_per_frame},
      {"device_bytes", setup.made.renderer->scene_bytes()},
      {"quality", nullptr}};
  if (result.quality) {
    json["quality"] = {{"against", result.quality->against},
                       {"key", to_json(result.quality->key, result.quality->whole_images)},
                       {"sub", to_json(result.quality->sub, result.quality->whole_images)}};
  }
  return json;
}

void print_quality(std::string_view kind, const QualityReport& report, const QualityTally& tally) {
  if (tally.frames() == 0) return;
  fmt::print("{:<14}{:.2f} dB mean, {:.2f} dB worst frame", fmt::format("{} frames", kind),
             tally.mean_psnr(), tally.min_psnr());
  if (report.whole_images) {
    fmt::print(", {:.2f} dB worst block; SSIM {:.5f} mean, {:.5f} worst", tally.worst_block_psnr(),
               tally.mean_ssim(), tally.min_ssim());
  }
  fmt::print("\n");
}

void print_summary(const BenchOptions& options, const RenderSetup& setup,
                   const BenchResult& result) {
  const Measurement& measurement = result.measurement;
  const Summary all = summarize(measurement.frame_ms());
  const ListLength lists = list_length(measurement);
  fmt::print("{}, {} Gaussians, SH {}; {}x{}, {} pipeline\n", setup.scene.name, setup.cloud->size(),
             setup.cloud->sh_degree, setup.camera.size_px.x, setup.camera.size_px.y,
             options.render.pipeline);
  fmt::print("{} ({})\n", setup.made.renderer->description(), setup.made.reason);
  fmt::print("{:<14}{:.1f} fps over {} frames\n", "speed", measurement.fps(), all.count);
  fmt::print("{:<14}{:.2f} mean, {:.2f} p50, {:.2f} p95, {:.2f} p99, {:.2f} max; flatness {:.2f}\n",
             "frame ms", all.mean, all.p50, all.p95, all.p99, all.max,
             flatness(measurement.frame_ms()));
  fmt::print("{:<14}", "stage ms");
  for (std::size_t i = 0; i < stage_count; ++i) {
    fmt::print("{}{} {:.2f}", i == 0 ? "" : ", ", stage_names[i],
               measurement.mean_stage_ms(static_cast<Stage>(i)));
  }
  fmt::print("\n{:<14}{:.0f} visible, {:.0f} list entries ({} in the longest tile), {:.0f} pairs\n",
             "mean frame", lists.visible_mean, lists.mean, lists.tile_max,
             result.pair_cost.pairs_per_frame);
  fmt::print("{:<14}{:.2f} ns per Gaussian before the blend, {:.3f} ns per blended pair\n", "cost",
             result.ns_per_gaussian(setup), result.pair_cost.ns_per_pair);
  if (lists.overflowed > 0) {
    fmt::print("{:<14}{} list entries found no memory and were not drawn\n", "OVERFLOW",
               lists.overflowed);
  }
  if (!result.quality) return;
  fmt::print("{:<14}against {}\n", "quality", result.quality->against);
  print_quality("key", *result.quality, result.quality->key);
  print_quality("sub", *result.quality, result.quality->sub);
}

void write_json(const std::string& path, const Json& json) {
  if (path == "-") {
    fmt::print("{}\n", json.dump(2));
    return;
  }
  std::ofstream file(path);
  file << json.dump(2) << std::endl;
  if (!file) throw InputError(path, "", "cannot be written", "does the folder exist?");
}

void bench(const BenchOptions& options, bool quiet) {
  const RenderSetup setup = prepare(options.render, quiet);
  BenchResult result;
  {
    Progress progress("measuring", quiet);
    result.measurement =
        measure(setup, options.warmup, [&](double fraction) { progress.update(fraction); });
  }
  result.pair_cost = count_pairs(setup, result.measurement);
  if (options.quality) {
    Progress progress("judging", quiet);
    result.quality =
        judge(setup, options.quality_every, [&](double fraction) { progress.update(fraction); });
  }
  if (options.json != "-") print_summary(options, setup, result);
  if (!options.json.empty()) write_json(options.json, report_json(options, setup, result));
}

}  // namespace

void add_bench_command(CLI::App& app) {
  auto options = std::make_shared<BenchOptions>();
  CLI::App* command = app.add_subcommand("bench", "Measures how fast a camera path renders");
  add_render_options(*command, options->render);
  command->add_option("--warmup", options->warmup, "Frames rendered before measuring")
      ->capture_default_str();
  command->add_flag("--quality", options->quality,
                    "Compare with the exact pipeline, or that with the reference");
  command->add_option("--quality-every", options->quality_every, "Judge every N-th frame only")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--json", options->json, "Write the report here; - prints it instead");
  command->callback([options, command] { bench(*options, is_quiet(*command)); });
}

}  // namespace catgs
