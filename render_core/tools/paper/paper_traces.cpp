// The table traces, each trace alone: speed of exact culling, of the paper's pipeline and of ours;
// evenness and quality of ours.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "render_core/metrics/summary.h"
#include "render_core/tools/paper/paper_tables.h"

namespace catgs {
namespace {

PaperTable::Row row(std::string name, const Measurement& exact, const Measurement& paper,
                    const Measurement& ours, double flat, const QualityReport& quality) {
  return {std::move(name),
          {{exact.fps()},
           {paper.fps()},
           {ours.fps()},
           {ours.fps() / exact.fps(), 2, "×"},
           {flat, 2},
           {summarize(ours.frame_ms()).p99, 2},
           {quality.key.mean_psnr()},
           {quality.key.min_psnr()},
           {quality.key.worst_block_psnr()},
           {quality.key.block_0_1_percent_psnr()},
           {100.0 * quality.see_through.max, 0, " %"}}};
}

void add(QualityReport& all, const QualityReport& report) {
  all.key.add(report.key);
  all.see_through.add(report.see_through);
}

}  // namespace

PaperTable traces_table(PaperCase& scene) {
  PaperTable table{
      .title = scene.label(),
      .columns = {"Exact FPS", "Paper FPS", "Ours FPS", "Ours over Exact", "Flatness", "p99 ms",
                  "Mean dB", "Worst frame dB", "Worst block dB", "0.1 % block dB", "See-through"},
      .notes = {fmt::format(
          "Quality is that of ours against Exact at the same poses, one frame in {}: PSNR. "
          "See-through is the largest share of a picture's pixels that more than half of the "
          "background shows through.",
          scene.options().every)}};
  const std::vector<Measurement>& exact = scene.runs(variants::exact);
  const std::vector<Measurement>& paper = scene.runs(variants::paper);
  const std::vector<Measurement>& ours = scene.runs(variants::ours);
  QualityReport whole;
  double worst_flat = 0.0;
  scene.for_each_trace("quality", [&](std::size_t trace, const ProgressReport& report) {
    const QualityReport quality =
        judge(scene.setup(), scene.settings(variants::ours), scene.options().every, report);
    const double flat = flatness(ours[trace].frame_ms());
    const std::string name = scene.trace_name(trace);
    table.rows.push_back(row(name, exact[trace], paper[trace], ours[trace], flat, quality));
    add(whole, quality);
    worst_flat = std::max(worst_flat, flat);
  });
  if (table.rows.size() > 1) {
    table.rows.push_back(row("All", pooled(exact), pooled(paper), pooled(ours), worst_flat, whole));
  }
  return table;
}

}  // namespace catgs
