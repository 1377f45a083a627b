// The table floor: the distance of each stage from the least time for its bytes and evaluations.
#include <string>
#include <utility>

#include <fmt/format.h>

#include "render_core/math/constants.h"
#include "render_core/tools/paper/floor_model.h"
#include "render_core/tools/paper/paper_tables.h"
#include "render_core/tools/paper/work_count.h"

namespace catgs {
namespace {

constexpr std::size_t max_counted_frames = 8;  // of a trace

/// Means over some frames of all traces.
struct MeanWork {
  double reached_entries = 0.0, warp_evaluations = 0.0, blended_pairs = 0.0;
  std::size_t frames = 0;
};

MeanWork count_work(PaperCase& scene) {
  MeanWork mean;
  scene.for_each_trace("work", [&](std::size_t, const ProgressReport& report) {
    const RenderSetup& setup = scene.setup();
    const std::size_t count = std::min(max_counted_frames, setup.poses.size());
    for (std::size_t k = 0; k < count; ++k) {
      const Camera camera = setup.request(k * setup.poses.size() / count).camera;
      const WorkCount work = count_work(setup.whole_cloud("--table floor"), camera, *setup.pool);
      mean.reached_entries += static_cast<double>(work.reached_entries);
      mean.warp_evaluations += static_cast<double>(work.warp_evaluations);
      mean.blended_pairs += static_cast<double>(work.blended_pairs);
      ++mean.frames;
      report(static_cast<double>(k + 1) / static_cast<double>(count));
    }
  });
  const auto frames = static_cast<double>(mean.frames);
  mean.reached_entries /= frames;
  mean.warp_evaluations /= frames;
  mean.blended_pairs /= frames;
  return mean;
}

FrameWork frame_work(const PaperCase& scene, const MeanWork& work) {
  const RenderSetup& setup = scene.setup();
  const glm::ivec2 size = setup.camera.size_px;
  const glm::ivec2 tiles = (size + (tile_size_px - 1)) / tile_size_px;
  FrameWork frame;
  frame.gaussians = static_cast<double>(setup.gaussians());
  frame.scene_bytes = static_cast<double>(setup.made.renderer->scene_bytes());
  frame.reached_entries = work.reached_entries;
  frame.warp_evaluations = work.warp_evaluations;
  frame.tiles = static_cast<double>(tiles.x) * tiles.y;
  frame.pixels = static_cast<double>(size.x) * size.y;
  return frame;
}

/// Adds rows for the frames of a kind: one for each stage, and one for the frame.
void add_rows(PaperTable& table, const std::string& name, const Measurement& run, FrameKind kind,
              FrameWork frame, const DeviceRates& rates) {
  if (run.frame_ms(kind).empty()) return;
  const ListLength lists = run.list_length(kind);
  frame.visible = lists.visible_mean;
  frame.list_entries = lists.mean;
  const auto add = [&](const std::string& what, double measured_ms, const StageWork& work,
                       double least_ms) {
    table.rows.push_back({name + what,
                          {{measured_ms, 3},
                           {1e-6 * work.bytes},
                           {bytes_ms(work, rates), 3},
                           {1e-6 * work.evaluations, 2},
                           {evaluations_ms(work, rates), 3},
                           {least_ms, 3},
                           {least_ms > 0.0 ? measured_ms / least_ms : Number::nothing, 1, "×"}}});
  };
  StageWork sum;
  double sum_ms = 0.0, measured_sum_ms = 0.0;
  for (std::size_t i = 0; i < stage_count; ++i) {
    const auto stage = static_cast<Stage>(i);
    const StageWork work = stage_work(stage, kind, frame);
    const double measured_ms = run.mean_stage_ms(stage, kind);
    measured_sum_ms += measured_ms;
    sum.bytes += work.bytes;
    sum.evaluations += work.evaluations;
    sum_ms += floor_ms(work, rates);
    if (stage == Stage::convert) continue;  // the picture stays where it is
    add(fmt::format(" {}", stage_names[i]), measured_ms, work, floor_ms(work, rates));
  }
  add("", measured_sum_ms, sum, sum_ms);
}

}  // namespace

PaperTable floor_table(PaperCase& scene) {
  const Measurement exact = pooled(scene.runs(variants::exact));
  const Measurement paper = pooled(scene.runs(variants::paper));
  const MeanWork work = count_work(scene);
  const FrameWork frame = frame_work(scene, work);
  const DeviceRates& rates = scene.options().rates;
  PaperTable table{
      .title = scene.label(),
      .corner = {},
      .columns = {"Measured ms", "MB", "ms of bytes", "Evaluations (10⁶)", "ms of evaluations",
                  "Floor ms", "Measured over floor"},
      .rows = {},
      .notes = {
          fmt::format("At {:g} TB/s and {:g} · 10¹² warp instructions a second, {:g} for an "
                      "evaluation: one list entry on 8x4 pixels. Floor: the longer of the two.",
                      1e-12 * rates.dram_bytes_per_s, 1e-12 * rates.warp_instructions_per_s,
                      rates.instructions_per_evaluation),
          "Bytes: what a stage cannot avoid moving (floor_model.h); what stays in a cache costs "
          "less. Sub-frames: as if colours were cached.",
          fmt::format("{}: {:.2f} · 10⁶ list entries reached, {:.2f} · 10⁶ evaluations and {:.1f} "
                      "· 10⁶ pairs blended, means of {} frames counted on the CPU.",
                      scene.label(), 1e-6 * work.reached_entries, 1e-6 * work.warp_evaluations,
                      1e-6 * work.blended_pairs, work.frames)}};
  add_rows(table, "Exact", exact, FrameKind::key, frame, rates);
  add_rows(table, "Key frame", paper, FrameKind::key, frame, rates);
  add_rows(table, "Sub-frame", paper, FrameKind::sub, frame, rates);
  return table;
}

}  // namespace catgs
