#include "render_core/tools/bench_measure.h"

#include <algorithm>
#include <chrono>

namespace catgs {
namespace {

using Clock = std::chrono::steady_clock;

double ms_between(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double, std::milli>(to - from).count();
}

}  // namespace

double Measurement::fps() const {
  return wall_ms > 0.0 ? 1000.0 * static_cast<double>(frames.size()) / wall_ms : 0.0;
}

std::vector<double> Measurement::frame_ms(FrameKind kind) const {
  std::vector<double> times;
  for (const Frame& frame : frames) {
    if (frame.stats.kind == kind) times.push_back(frame.ms);
  }
  return times;
}

std::vector<double> Measurement::frame_ms() const {
  std::vector<double> times;
  for (const Frame& frame : frames) times.push_back(frame.ms);
  return times;
}

double Measurement::mean_stage_ms(Stage stage) const {
  double sum = 0.0;
  for (const Frame& frame : frames) sum += frame.stats.stage_ms[static_cast<std::size_t>(stage)];
  return frames.empty() ? 0.0 : sum / static_cast<double>(frames.size());
}

Measurement measure(const RenderSetup& setup, std::size_t warmup, const ProgressReport& report) {
  const auto view = setup.made.renderer->make_view(
      {.pipeline = setup.pipeline, .format = PixelFormat::rgb_f32, .space = MemorySpace::device});
  FrameView frame;
  for (std::size_t i = 0; i < std::min(warmup, setup.poses.size()); ++i) {
    render_or_throw(*view, setup.request(i), frame);
  }
  Measurement measurement;
  measurement.frames.reserve(setup.poses.size());
  const auto start = Clock::now();
  auto last = start;
  for (std::size_t i = 0; i < setup.poses.size(); ++i) {
    render_or_throw(*view, setup.request(i), frame);
    const auto now = Clock::now();
    measurement.frames.push_back({ms_between(last, now), frame.stats});
    last = now;
    report(static_cast<double>(i + 1) / static_cast<double>(setup.poses.size()));
  }
  measurement.wall_ms = ms_between(start, Clock::now());
  return measurement;
}

PairCost count_pairs(const RenderSetup& setup, const Measurement& measurement) {
  constexpr std::size_t max_counted_frames = 8;
  const auto view = setup.made.renderer->make_view(
      {.pipeline = setup.pipeline, .format = PixelFormat::rgb_f32, .count_pairs = true});
  const std::size_t counted = std::min(max_counted_frames, setup.poses.size());
  double pairs = 0.0;
  double blend_ms = 0.0;
  for (std::size_t k = 0; k < counted; ++k) {
    const std::size_t i = k * setup.poses.size() / counted;
    FrameView frame;
    render_or_throw(*view, setup.request(i), frame);
    pairs += static_cast<double>(frame.stats.blended_pairs);
    blend_ms += measurement.frames[i].stats.stage_ms[static_cast<std::size_t>(Stage::blend)];
  }
  PairCost cost;
  if (pairs > 0.0) {
    cost.pairs_per_frame = pairs / static_cast<double>(counted);
    cost.ns_per_pair = 1e6 * blend_ms / pairs;
  }
  return cost;
}

}  // namespace catgs
