// The table traces, each trace alone: speed of ours and of exact culling, evenness, share of key
// frames, and quality of sub-frames.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "render_core/metrics/summary.h"
#include "render_core/tools/paper/paper_tables.h"

namespace catgs {
namespace {

PaperTable::Row row(std::string name, const Measurement& exact, const Measurement& ours,
                    double flat, const QualityReport& quality) {
  const QualityTally& sub = quality.sub;
  const auto of_sub = [&](double value, int decimals = 1) {
    return Number{sub.frames() > 0 ? value : Number::nothing, decimals};
  };
  const double pop = quality.pop.count > 0 ? 255.0 * quality.pop.max : Number::nothing;
  return {std::move(name),
          {{exact.fps()},
           {ours.fps()},
           {ours.fps() / exact.fps(), 2, "×"},
           {flat, 2},
           {summarize(ours.frame_ms()).p99, 2},
           {ours.frames_per_key(), 2},
           {100.0 * ours.keys_without_window(), 0, " %"},
           of_sub(sub.mean_psnr()),
           of_sub(sub.min_psnr()),
           of_sub(sub.worst_block_psnr()),
           of_sub(sub.block_0_1_percent_psnr()),
           {pop, 2},
           {100.0 * quality.see_through.max, 0, " %"}}};
}

void add(QualityReport& all, const QualityReport& report) {
  all.key.add(report.key);
  all.sub.add(report.sub);
  all.pop.add(report.pop);
  all.see_through.add(report.see_through);
}

std::string windows(const Measurement& run) {
  std::string text;
  for (const auto& [window, count] : run.window_histogram()) {
    text += fmt::format("{}{}: {}", text.empty() ? "" : ", ", window, count);
  }
  return text;
}

}  // namespace

PaperTable traces_table(PaperCase& scene) {
  PaperTable table{
      .title = scene.label(),
      .corner = {},
      .columns = {"Exact FPS", "Ours FPS", "Ours over Exact", "Flatness", "p99 ms",
                  "Frames per key", "Keys without window", "Sub mean dB", "Worst sub dB",
                  "Worst block dB", "0.1 % block dB", "Pop (1/255)", "See-through"},
      .rows = {},
      .notes = {fmt::format(
          "Quality against Exact at the same poses, one frame and one key switch in {}: PSNR of "
          "the sub-frames; what a switch adds to the true change, p99.9 of the worst; most pixels "
          "that over half of the background shows through.",
          scene.options().every)}};
  const std::vector<Measurement>& exact = scene.runs(variants::exact);
  const std::vector<Measurement>& ours = scene.runs(variants::ours);
  QualityReport whole;
  double worst_flat = 0.0;
  scene.for_each_trace("quality", [&](std::size_t trace, const ProgressReport& report) {
    const QualityReport quality =
        judge(scene.setup(), scene.settings(variants::ours), scene.options().every, report);
    const double flat = flatness(ours[trace].frame_ms());
    const std::string name = scene.trace_name(trace);
    table.rows.push_back(row(name, exact[trace], ours[trace], flat, quality));
    table.notes.push_back(fmt::format("{}: key frames by window {}.", name, windows(ours[trace])));
    add(whole, quality);
    worst_flat = std::max(worst_flat, flat);
  });
  if (table.rows.size() > 1) {
    table.rows.push_back(row("All", pooled(exact), pooled(ours), worst_flat, whole));
  }
  return table;
}

}  // namespace catgs
