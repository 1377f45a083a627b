// The paper's table about the length of the window, and its curve: growth of lists with the trails
// that they cover.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "render_core/math/camera-inl.h"
#include "render_core/metrics/summary.h"
#include "render_core/tools/frame_feed.h"
#include "render_core/tools/paper/paper_tables.h"

namespace catgs {
namespace {

/// Makes windows independent of motion: longer than any trail, but finite, so that an unbounded
/// trail (through the near plane) still gets no window.
constexpr float any_trail_px = 1e9f;
/// Longer than the predictor's usual 100 ms, so that no forecast ends a window either.
constexpr std::int64_t any_horizon_us = 1'000'000;

constexpr std::size_t max_trail_frames = 32;
constexpr std::size_t max_trail_gaussians = 50'000;

/// Adds the displacements of Gaussian centres in the image while the camera moves from `now` to
/// `end`: their sum and number. Takes a sample of the Gaussians that are in front of the camera at
/// both ends, and in the first picture.
void add_trails(const GaussianCloud& cloud, const Camera& now, const Camera& end, Extent& trails) {
  const auto from = math::make_camera_model(now), to = math::make_camera_model(end);
  const std::size_t stride = 1 + cloud.size() / max_trail_gaussians;
  for (std::size_t i = 0; i < cloud.size(); i += stride) {
    const glm::dvec3 mean(cloud.mean[i]);
    const math::Vec3<double> point{mean.x, mean.y, mean.z};
    const auto before = math::camera_from_world(from, point);
    const auto after = math::camera_from_world(to, point);
    if (!(before.z > from.near_z && after.z > to.near_z)) continue;
    const auto a = math::image_px(from, before), b = math::image_px(to, after);
    if (a.x < 0.0 || a.y < 0.0 || a.x > now.size_px.x || a.y > now.size_px.y) continue;
    trails.add(std::hypot(b.x - a.x, b.y - a.y));
  }
}

/// Adds the trails of some key frames with a full window of one run; `setup` has its trace.
void add_trails(const RenderSetup& setup, const ViewSettings& settings, const Measurement& run,
                Extent& trails) {
  const int window = settings.speculation.initial_window;
  const auto takes = [window](const Measurement::Frame& frame) {
    return frame.stats.kind == FrameKind::key && frame.stats.window == window;
  };
  const auto keys = static_cast<std::size_t>(std::ranges::count_if(run.frames, takes));
  const std::size_t stride = 1 + keys / max_trail_frames;
  FrameFeed feed(setup, settings);
  std::size_t key = 0;
  for (const Measurement::Frame& frame : run.frames) {
    const FrameRequest request = feed.next();
    if (!takes(frame) || key++ % stride != 0) continue;
    Camera end = request.camera;
    end.world_from_camera = request.forecast->world_from_camera;
    add_trails(setup.whole_cloud("--table window"), request.camera, end, trails);
  }
}

/// The column for one window.
struct WindowColumn {
  Number list, growth, mean_trail, held, p99_ms, max_ms;
};

WindowColumn without_window(const std::vector<Measurement>& runs,
                            const std::vector<Measurement>& exact) {
  const Measurement all = pooled(runs);
  const Summary times = summarize(all.frame_ms());
  const auto any = [](const FrameStats&) { return true; };
  return {{1e-3 * all.list_length().mean},
          {key_list_growth(runs, exact, any), 3, "×"},
          {},
          {},
          {times.p99, 2},
          {times.max, 2}};
}

WindowColumn with_window(PaperCase& scene, int window, const std::vector<Measurement>& exact) {
  ViewSettings settings = scene.settings(variants::paper);
  settings.speculation.initial_window = window;
  settings.speculation.max_trail_px = any_trail_px;
  const std::vector<Measurement> runs = scene.runs(settings, fmt::format("W-{}", window));
  const auto takes = [window](const FrameStats& stats) { return stats.window == window; };
  Extent lists, trails;
  std::size_t keys = 0;
  for (const Measurement& run : runs) {
    for (const Measurement::Frame& frame : run.frames) {
      if (frame.stats.kind != FrameKind::key) continue;
      ++keys;
      if (!takes(frame.stats)) continue;
      lists.add(1e-3 * static_cast<double>(frame.stats.list_entries));
    }
  }
  if (lists.count == 0) return {};
  scene.for_each_trace("trails", [&](std::size_t trace, const ProgressReport&) {
    add_trails(scene.setup(), settings, runs[trace], trails);
  });
  const Summary times = summarize(pooled(runs).frame_ms());
  const double held = 100.0 * static_cast<double>(lists.count) / static_cast<double>(keys);
  return {{lists.mean()},     {key_list_growth(runs, exact, takes), 3, "×"},
          {trails.mean(), 2}, {held, 0, " %"},
          {times.p99, 2},     {times.max, 2}};
}

}  // namespace

PaperTable window_table(PaperCase& scene) {
  PaperTable table{
      .title = scene.label(),
      .rows = {{"List length (10³)", {}},
               {"Over Exact", {}},
               {"Mean trail (px)", {}},
               {"Key frames with the window", {}},
               {"p99 latency (ms)", {}},
               {"Max latency (ms)", {}}},
      .notes = {
          "W-n: windows of n sub-frames, held whatever the motion. Lists and trails are those "
          "of key frames with the whole window; Over Exact compares them with Exact at the "
          "same poses.",
          "Mean trail: of the centres of the Gaussians in the picture, over the window."}};
  const auto add = [&table](std::string name, const WindowColumn& c) {
    add_column(table, std::move(name),
               {c.list, c.growth, c.mean_trail, c.held, c.p99_ms, c.max_ms});
  };
  const std::vector<Measurement>& exact = scene.runs(variants::exact);
  add("Exact", without_window(exact, exact));
  add("None", without_window(scene.runs(variants::without_cache), exact));
  const PredictorSettings usual = scene.setup().predictor;
  PredictorSettings patient = usual;
  patient.horizon_us = any_horizon_us;
  patient.min_confidence = 1.0;
  scene.predict_by(patient);
  for (const int window : {1, 2, 4, 8, 16}) {
    add(fmt::format("W-{}", window), with_window(scene, window, exact));
  }
  scene.predict_by(usual);
  return table;
}

}  // namespace catgs
