#include "render_core/tools/bench/bench_report.h"

#include <algorithm>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/build_info.h"
#include "render_core/metrics/summary.h"

namespace catgs {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const Summary& summary) {
  if (summary.count == 0) return nullptr;
  return {{"mean", summary.mean},
          {"p50", summary.p50},
          {"p95", summary.p95},
          {"p99", summary.p99},
          {"max", summary.max}};
}

Json to_json(const QualityTally& tally, bool whole_images) {
  if (tally.frames() == 0) return nullptr;
  Json json = {{"frames", tally.frames()},
               {"psnr_db", {{"mean", tally.mean_psnr()}, {"min", tally.min_psnr()}}},
               {"worst_frame", tally.worst_frame()}};
  if (whole_images) {
    json["ssim"] = {{"mean", tally.mean_ssim()}, {"min", tally.min_ssim()}};
    json["worst_block_psnr_db"] = tally.worst_block_psnr();
    json["worst_block_frame"] = tally.worst_block_frame();
    json["block_0_1_percent_psnr_db"] = tally.block_0_1_percent_psnr();
  }
  return json;
}

Json to_json(const QualityReport& quality) {
  Json json = {{"against", quality.against},
               {"key", to_json(quality.key, quality.whole_images)},
               {"sub", to_json(quality.sub, quality.whole_images)},
               {"see_through", nullptr},
               {"pop", nullptr}};
  if (quality.see_through.count > 0) {
    json["see_through"] = {{"mean", quality.see_through.mean()}, {"max", quality.see_through.max}};
  }
  if (quality.pop.count > 0) {
    json["pop"] = {{"steps", quality.pop.count}, {"mean", quality.pop.mean()},
                   {"max", quality.pop.max},     {"worst_frame", quality.worst_pop_frame},
                   {"allowed", max_pop},         {"over", quality.pops}};
  }
  return json;
}

Json stages_json(const Measurement& measurement, Measurement::Kind kind) {
  Json stages;
  for (std::size_t i = 0; i < stage_count; ++i) {
    stages[std::string(stage_names[i])] = measurement.mean_stage_ms(static_cast<Stage>(i), kind);
  }
  return stages;
}

Json lists_json(const Measurement& measurement, Measurement::Kind kind) {
  const ListLength lists = measurement.list_length(kind);
  return {{"mean", lists.mean}, {"max", lists.max}, {"tile_max", lists.tile_max}};
}

/// Adds frame_ms, stage_ms and list_length of the frames of one kind.
void add_times(Json& json, const Measurement& measurement, Measurement::Kind kind,
               const std::string& suffix) {
  const std::vector<double> times = measurement.frame_ms(kind);
  json["frame_ms" + suffix] = to_json(summarize(times));
  json["stage_ms" + suffix] = times.empty() ? Json() : stages_json(measurement, kind);
  json["list_length" + suffix] = times.empty() ? Json() : lists_json(measurement, kind);
}

Json pages_json(const Measurement& measurement) {
  const PageUsage pages = measurement.pages();
  return {{"nodes_mean", pages.nodes_mean},
          {"missing_mean", pages.missing_mean},
          {"missing_max", pages.missing_max},
          {"coarsest_px", pages.coarsest_px},
          {"sharp_ms", to_json(summarize(measurement.sharp_ms))}};
}

Json settings_json(const RenderOptions& options, const RenderSetup& setup,
                   const BenchResult& result) {
  Json json;
  if (options.trace.empty()) {
    const ScriptOptions script = script_options(options);
    json["script"] = script.script;
    json["seed"] = script.seed;
    json["duration_s"] = script.duration_s;
  } else {
    json["trace"] = options.trace;
    json["anchor"] = options.anchor;
  }
  json["fps"] = setup.fps;
  json["frames"] = {setup.first, setup.first + setup.poses.size()};
  const glm::ivec2 size_px = setup.picture_px();
  json["size_px"] = {size_px.x, size_px.y};
  if (setup.eye_distance) json["eye_distance"] = *setup.eye_distance;
  json["focal_px"] = setup.camera.focal_px.x;
  json["near"] = setup.camera.near_z;
  const ViewSettings& settings = result.settings;
  json["pipeline"] = pipeline_name(settings.pipeline);
  if (setup.made.renderer->has_windows(settings.pipeline)) {
    const SpeculationSettings& speculation = settings.speculation;
    json["window"] = speculation.initial_window;
    json["max_trail_px"] = speculation.max_trail_px;
    json["min_depth"] = speculation_min_depth(speculation, setup.camera.near_z);
    json["max_deviation_px"] = speculation.max_deviation_px;
    json["constant_velocity"] = options.pipeline.constant_velocity;
  }
  if (keeps_colours(settings.pipeline)) json["colour_cache"] = settings.colour_cache;
  json["split_tasks"] = settings.split_tasks;
  json["simd"] = options.simd;
  json["threads"] = setup.pool->threads();
  json["warmup"] = result.warmup;
  json["views"] = result.views;
  return json;
}

void print_times(std::string_view name, const Measurement& measurement, Measurement::Kind kind) {
  const Summary times = summarize(measurement.frame_ms(kind));
  fmt::print("{:<14}{:.2f} mean, {:.2f} p50, {:.2f} p95, {:.2f} p99, {:.2f} max", name, times.mean,
             times.p50, times.p95, times.p99, times.max);
  for (std::size_t i = 0; i < stage_count; ++i) {
    fmt::print("{}{} {:.2f}", i == 0 ? "; " : ", ", stage_names[i],
               measurement.mean_stage_ms(static_cast<Stage>(i), kind));
  }
  fmt::print("\n");
}

void print_groups(const Measurement& measurement) {
  const std::size_t keys = measurement.frame_ms(FrameKind::key).size();
  const std::size_t subs = measurement.frame_ms(FrameKind::sub).size();
  fmt::print(
      "{:<14}{} key frames, {} sub-frames: {:.2f} frames per key frame, {:.0f} % of the keys "
      "without a window; windows",
      "groups", keys, subs, measurement.frames_per_key(),
      100.0 * measurement.keys_without_window());
  for (const auto& [window, count] : measurement.window_histogram()) {
    fmt::print(" {}: {}", window, count);
  }
  fmt::print("; {} left early\n", measurement.windows_cut());
}

void print_quality(std::string_view name, const QualityReport& report, const QualityTally& tally) {
  if (tally.frames() == 0) return;
  fmt::print("{:<14}{:.2f} dB mean, {:.2f} dB worst frame ({})", name, tally.mean_psnr(),
             tally.min_psnr(), tally.worst_frame());
  if (report.whole_images) {
    fmt::print(
        ", {:.2f} dB worst block ({}), {:.2f} dB 0.1 % block; SSIM {:.5f} mean, {:.5f} worst",
        tally.worst_block_psnr(), tally.worst_block_frame(), tally.block_0_1_percent_psnr(),
        tally.mean_ssim(), tally.min_ssim());
  }
  fmt::print("\n");
}

/// `groups`: whether the pipeline has key frames and sub-frames.
void print_quality(const QualityReport& quality, bool groups) {
  fmt::print("{:<14}against {}\n", "quality", quality.against);
  print_quality(groups ? "key frames" : "frames", quality, quality.key);
  print_quality("sub-frames", quality, quality.sub);
  if (quality.see_through.count > 0) {
    fmt::print("{:<14}{:.1f} % of the pixels on average, {:.1f} % at most\n", "see-through",
               100.0 * quality.see_through.mean(), 100.0 * quality.see_through.max);
  }
  if (quality.pop.count > 0) {
    fmt::print("{:<14}{:.2f}/255 mean, {:.2f}/255 worst of {} steps{} (frame {}), {} over 1/255\n",
               "pop", 255.0 * quality.pop.mean(), 255.0 * quality.pop.max, quality.pop.count,
               groups ? " to key frames" : "", quality.worst_pop_frame, quality.pops);
  }
}

void print_pages(const Measurement& measurement, float detail_px) {
  const PageUsage pages = measurement.pages();
  fmt::print(
      "{:<14}{} px: {:.0f} nodes drawn; {:.1f} pages missing, {} at most{}\n", "detail", detail_px,
      pages.nodes_mean, pages.missing_mean, pages.missing_max,
      pages.coarsest_px > 0.0f ? fmt::format("; coarsest {:.3g} px", pages.coarsest_px) : "");
  const Summary sharp = summarize(measurement.sharp_ms);
  fmt::print("{:<14}{:.0f} ms after a jump to a new place, {:.0f} ms at most\n", "sharp",
             sharp.mean, sharp.max);
}

}  // namespace

double BenchResult::ns_per_gaussian(const RenderSetup& setup) const {
  const double ms = measurement.mean_stage_ms(Stage::project) +
                    measurement.mean_stage_ms(Stage::bin) + measurement.mean_stage_ms(Stage::sort);
  return 1e6 * ms / static_cast<double>(std::max<std::uint64_t>(setup.gaussians(), 1));
}

Json report_json(const RenderOptions& options, const RenderSetup& setup,
                 const BenchResult& result) {
  const Measurement& measurement = result.measurement;
  const ListLength lists = measurement.list_length();
  Json windows = Json::object();
  for (const auto& [window, count] : measurement.window_histogram()) {
    windows[std::to_string(window)] = count;
  }
  Json json = {{"version", build_version},
               {"commit", build_commit},
               {"device", setup.made.renderer->description()},
               {"device_reason", setup.made.reason},
               {"scene",
                {{"name", setup.scene.name},
                 {"format", setup.scene.format},
                 {"gaussians", setup.gaussians()},
                 {"sh_degree", setup.cloud->sh_degree},
                 {"hash", setup.hash()}}},
               {"settings", settings_json(options, setup, result)},
               {"fps_mean", measurement.fps()},
               {"flatness", flatness(measurement.frame_ms())}};
  add_times(json, measurement, std::nullopt, "");
  add_times(json, measurement, FrameKind::key, "_key");
  add_times(json, measurement, FrameKind::sub, "_sub");
  json["visible_mean"] = lists.visible_mean;
  json["overflowed_entries"] = lists.overflowed;
  json["key_frames"] = measurement.frame_ms(FrameKind::key).size();
  json["sub_frames"] = measurement.frame_ms(FrameKind::sub).size();
  json["frames_per_key"] = measurement.frames_per_key();
  json["keys_without_window"] = measurement.keys_without_window();
  json["window_histogram"] = windows;
  json["windows_cut"] = measurement.windows_cut();
  if (setup.tree) json["pages"] = pages_json(measurement);
  json["ns_per_gaussian"] = result.ns_per_gaussian(setup);
  json["ns_per_blended_pair"] = result.pair_cost.ns_per_pair;
  json["blended_pairs_mean"] = result.pair_cost.pairs_per_frame;
  json["scene_bytes"] = setup.made.renderer->scene_bytes();
  json["view_bytes"] = measurement.view_bytes;
  json["device_bytes"] = setup.made.renderer->scene_bytes() + measurement.view_bytes;
  json["quality"] = result.quality ? to_json(*result.quality) : Json();
  return json;
}

void print_report(const RenderSetup& setup, const BenchResult& result) {
  const Measurement& measurement = result.measurement;
  const ListLength lists = measurement.list_length();
  const bool groups = setup.made.renderer->has_windows(result.settings.pipeline);
  fmt::print("{}, {} Gaussians, SH {}; {}x{}, {} pipeline\n", setup.scene.name, setup.gaussians(),
             setup.cloud->sh_degree, setup.picture_px().x, setup.picture_px().y,
             pipeline_name(result.settings.pipeline));
  fmt::print("{} ({})\n", setup.made.renderer->description(), setup.made.reason);
  const std::string of_views = result.views > 1 ? fmt::format(" of {} views", result.views) : "";
  fmt::print("{:<14}{:.1f} fps over {} frames{}; flatness {:.2f}\n", "speed", measurement.fps(),
             measurement.frames.size(), of_views, flatness(measurement.frame_ms()));
  print_times("frame ms", measurement, std::nullopt);
  if (groups) {
    print_times("key frame ms", measurement, FrameKind::key);
    print_times("sub-frame ms", measurement, FrameKind::sub);
    print_groups(measurement);
  }
  fmt::print("{:<14}{:.0f} visible, {:.0f} list entries ({} in the longest tile), {:.0f} pairs\n",
             "mean frame", lists.visible_mean, lists.mean, lists.tile_max,
             result.pair_cost.pairs_per_frame);
  fmt::print("{:<14}{:.2f} ns per Gaussian before the blend, {:.3f} ns per blended pair\n", "cost",
             result.ns_per_gaussian(setup), result.pair_cost.ns_per_pair);
  fmt::print("{:<14}{:.1f} MB scene, {:.1f} MB view\n", "memory",
             1e-6 * static_cast<double>(setup.made.renderer->scene_bytes()),
             1e-6 * static_cast<double>(measurement.view_bytes));
  if (setup.tree) print_pages(measurement, setup.detail_px);
  if (lists.overflowed > 0) {
    fmt::print("{:<14}{} list entries found no memory and were not drawn\n", "OVERFLOW",
               lists.overflowed);
  }
  if (result.quality) print_quality(*result.quality, groups);
}

}  // namespace catgs
