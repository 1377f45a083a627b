#include "render_core/tools/bench/bench_measure.h"

#include <algorithm>
#include <chrono>
#include <future>
#include <memory>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/tools/frame_feed.h"

namespace catgs {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t page_step = 10;  // frames from one wait for pages to the next

double ms_between(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double, std::milli>(to - from).count();
}

/// One pass over the path, with a View that is warm.
std::vector<Measurement::Frame> time_path(const RenderSetup& setup, const ViewSettings& settings,
                                          View& view, const ProgressReport& report) {
  FrameFeed feed(setup, settings);
  std::vector<Measurement::Frame> frames;
  frames.reserve(setup.poses.size());
  auto last = Clock::now();
  for (std::size_t i = 0; i < setup.poses.size(); ++i) {
    FrameView frame;
    FrameRequest request = feed.next();
    request.waits_for_pages = false;
    render_or_throw(view, request, frame);
    const auto now = Clock::now();
    frames.push_back({ms_between(last, now), frame.stats, i == 0});
    last = now;
    report(static_cast<double>(i + 1) / static_cast<double>(setup.poses.size()));
  }
  return frames;
}

/// See Measurement::sharp_ms.
std::vector<double> time_rests(const RenderSetup& setup, const ViewSettings& settings) {
  constexpr std::size_t positions = 8;
  const auto view = setup.made.renderer->make_view(settings);
  std::vector<double> times;
  for (std::size_t position = 0; position < std::min(positions, setup.poses.size()); ++position) {
    FrameRequest request = setup.request(position * setup.poses.size() / positions);
    request.waits_for_pages = false;
    const auto arrival = Clock::now();
    FrameView frame;
    double ms = 0.0;
    do {
      render_or_throw(*view, request, frame);
      ms = ms_between(arrival, Clock::now());
    } while (!frame.stats.settled && ms < Measurement::longest_rest_ms);
    times.push_back(std::min(ms, Measurement::longest_rest_ms));
  }
  return times;
}

/// Calls body(i) for every i in [0, count): the first on this thread, each other on a thread of its
/// own. When all have ended, rethrows an exception of one of them.
template <class Body>
void side_by_side(std::size_t count, const Body& body) {
  std::vector<std::future<void>> others;
  for (std::size_t i = 1; i < count; ++i) {
    others.push_back(std::async(std::launch::async, [&body, i] { body(i); }));
  }
  body(0);
  for (std::future<void>& other : others) other.get();
}

template <class Visit>
void for_each_frame(const Measurement& measurement, Measurement::Kind kind, const Visit& visit) {
  for (const Measurement::Frame& frame : measurement.frames) {
    if (!kind || frame.stats.kind == *kind) visit(frame);
  }
}

}  // namespace

double Measurement::fps() const {
  return wall_ms > 0.0 ? 1000.0 * static_cast<double>(frames.size()) / wall_ms : 0.0;
}

std::vector<double> Measurement::frame_ms(Kind kind) const {
  std::vector<double> times;
  for_each_frame(*this, kind, [&](const Frame& frame) { times.push_back(frame.ms); });
  return times;
}

double Measurement::mean_stage_ms(Stage stage, Kind kind) const {
  double sum = 0.0;
  std::size_t count = 0;
  for_each_frame(*this, kind, [&](const Frame& frame) {
    sum += frame.stats.stage_ms[static_cast<std::size_t>(stage)];
    ++count;
  });
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

ListLength Measurement::list_length(Kind kind) const {
  ListLength length;
  std::size_t count = 0;
  for_each_frame(*this, kind, [&](const Frame& frame) {
    length.mean += static_cast<double>(frame.stats.list_entries);
    length.visible_mean += static_cast<double>(frame.stats.visible);
    length.max = std::max(length.max, frame.stats.list_entries);
    length.tile_max = std::max(length.tile_max, frame.stats.list_max);
    length.overflowed += frame.stats.overflowed_entries;
    ++count;
  });
  length.mean /= static_cast<double>(std::max<std::size_t>(count, 1));
  length.visible_mean /= static_cast<double>(std::max<std::size_t>(count, 1));
  return length;
}

PageUsage Measurement::pages() const {
  PageUsage usage;
  const double share = 1.0 / static_cast<double>(std::max<std::size_t>(frames.size(), 1));
  for (const Frame& frame : frames) {
    usage.nodes_mean += share * frame.stats.nodes;
    usage.missing_mean += share * frame.stats.missing_pages;
    usage.missing_max = std::max(usage.missing_max, frame.stats.missing_pages);
    usage.coarsest_px = std::max(usage.coarsest_px, frame.stats.coarsest_px);
  }
  return usage;
}

std::map<int, std::size_t> Measurement::window_histogram() const {
  std::map<int, std::size_t> histogram;
  for_each_frame(*this, FrameKind::key,
                 [&](const Frame& frame) { ++histogram[frame.stats.window]; });
  return histogram;
}

double Measurement::frames_per_key() const {
  const std::size_t keys = frame_ms(FrameKind::key).size();
  return keys == 0 ? 0.0 : static_cast<double>(frames.size()) / static_cast<double>(keys);
}

double Measurement::keys_without_window() const {
  const std::map<int, std::size_t> windows = window_histogram();
  const auto none = windows.find(0);
  const std::size_t keys = frame_ms(FrameKind::key).size();
  return none == windows.end() ? 0.0
                               : static_cast<double>(none->second) / static_cast<double>(keys);
}

std::size_t Measurement::windows_cut() const {
  std::size_t cut = 0;
  int missing = 0;  // sub-frames that the group still promised
  for (const Frame& frame : frames) {
    if (frame.stats.kind == FrameKind::key) {
      cut += missing > 0 && !frame.first ? 1 : 0;
      missing = frame.stats.window;
    } else {
      --missing;
    }
  }
  return cut;
}

std::size_t warmup_frames(std::optional<std::size_t> asked, const RenderSetup& setup) {
  const std::size_t most = setup.poses.size();
  if (asked && *asked > most) {
    throw InputError("--warmup", "", fmt::format("{} frames of a path of {}", *asked, most),
                     "the warm-up uses the path's first frames, so it has no more than the path");
  }
  return std::min(asked.value_or(default_warmup), most);
}

Measurement measure(const RenderSetup& setup, ViewSettings settings, std::size_t warmup,
                    const ProgressReport& report, std::size_t views) {
  settings.format = PixelFormat::rgb_f32;
  settings.space = MemorySpace::device;
  Measurement measurement;
  if (setup.tree) measurement.sharp_ms = time_rests(setup, settings);
  std::vector<std::unique_ptr<View>> warm(views);
  side_by_side(views, [&](std::size_t v) {
    warm[v] = setup.made.renderer->make_view(settings);
    FrameView frame;
    FrameFeed feed(setup, settings);
    for (std::size_t i = 0; i < warmup; ++i) {
      render_or_throw(*warm[v], feed.next(), frame);
    }
    // Where memory has room, the pages of the whole path are there before it is measured.
    if (setup.tree)
      for (std::size_t i = 0; i < setup.poses.size(); i += page_step) {
        render_or_throw(*warm[v], setup.request(i), frame);
      }
  });

  std::vector<std::vector<Measurement::Frame>> passes(views);
  const auto start = Clock::now();
  side_by_side(views, [&](std::size_t v) {
    passes[v] = time_path(
        setup, settings, *warm[v], v == 0 ? report : [](double) {});
  });
  measurement.wall_ms = ms_between(start, Clock::now());
  for (std::size_t v = 0; v < views; ++v) {
    measurement.frames.insert(measurement.frames.end(), passes[v].begin(), passes[v].end());
    measurement.view_bytes = std::max(measurement.view_bytes, warm[v]->memory_bytes());
  }
  return measurement;
}

PairCost count_pairs(const RenderSetup& setup, ViewSettings settings,
                     const Measurement& measurement) {
  constexpr std::size_t max_counted_frames = 8;
  settings.count_pairs = true;
  const auto view = setup.made.renderer->make_view(settings);
  const std::size_t counted = std::min(max_counted_frames, setup.poses.size());
  double pairs = 0.0;
  double blend_ms = 0.0;
  for (std::size_t k = 0; k < counted; ++k) {
    const std::size_t i = k * setup.poses.size() / counted;
    FrameView frame;
    render_or_throw(*view, setup.request(i > 0 ? i - 1 : i), frame);
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
