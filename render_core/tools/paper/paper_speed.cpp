// Tables of the paper about time: fps, ablation, stages, pruned.
#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "render_core/metrics/summary.h"
#include "render_core/tools/paper/paper_tables.h"

namespace catgs {
namespace {

Number fps(PaperCase& scene, const Variant& variant) { return {pooled(scene.runs(variant)).fps()}; }

std::uint64_t tasks(const std::vector<Measurement>& runs) {
  std::uint64_t sum = 0;
  for (const Measurement& run : runs) {
    for (const Measurement::Frame& frame : run.frames) sum += frame.stats.tasks;
  }
  return sum;
}

constexpr std::string_view fps_note =
    "Frames per second of wall clock, back to back, over all traces of a scene; the picture stays "
    "on the device.";

/// The stages as the paper counts them. It times separately how the lists' ranges are found; our
/// cores and our baseline do that while they sort.
struct PaperStage {
  std::string_view name;
  std::array<bool, stage_count> parts;  // project, bin, sort, blend, convert
};
constexpr std::array<PaperStage, 4> paper_stages = {
    {{"Pre-processing", {true, true, false, false, false}},
     {"Sorting", {false, false, true, false, false}},
     {"Tile Identify", {}},
     {"Rasterization", {false, false, false, true, false}}}};

double stage_ms(const Measurement& run, const PaperStage& stage, Measurement::Kind kind) {
  double ms = 0.0;
  for (std::size_t i = 0; i < stage_count; ++i) {
    if (stage.parts[i]) ms += run.mean_stage_ms(static_cast<Stage>(i), kind);
  }
  return ms;
}

PaperTable::Row speedups(std::string name, const Measurement& run, const Measurement& baseline,
                         Measurement::Kind kind) {
  PaperTable::Row row{std::move(name), {}};
  for (const PaperStage& stage : paper_stages) {
    const double before = stage_ms(baseline, stage, std::nullopt);
    const bool known = before > 0.0 && !run.frame_ms(kind).empty();
    const double now = stage_ms(run, stage, kind);
    const double none = std::numeric_limits<double>::infinity();
    row.numbers.push_back({!known ? Number::nothing : now > 0.0 ? before / now : none, 1, "×"});
  }
  return row;
}

}  // namespace

PaperTable fps_table(PaperCase& scene) {
  const Number vanilla = fps(scene, variants::vanilla), ours = fps(scene, variants::ours);
  return {.corner = "Average FPS",
          .columns = {scene.label()},
          .rows = {{"Model size", {{static_cast<double>(scene.setup().cloud->size()), 0}}},
                   {"3DGS", {vanilla}},
                   {"Exact", {fps(scene, variants::exact)}},
                   {"Paper-w/o cache", {fps(scene, variants::without_cache)}},
                   {"Paper", {fps(scene, variants::paper)}},
                   {"Ours", {ours}},
                   {"Ours over 3DGS", {{ours.value / vanilla.value, 2, "×"}}}},
          .notes = {std::string(fps_note),
                    "Model size: Gaussians. Exact: precise culling alone. Paper: CaT-GS as "
                    "published; without its caches, every frame is a key frame."}};
}

PaperTable ablation_table(PaperCase& scene) {
  PaperTable table{.title = scene.label(),
                   .columns = {"Average FPS", "of Full", "Flatness", "p99 ms", "Key frame ms",
                               "Sub-frame ms", "Frames per key", "Keys without window"},
                   .notes = {std::string(fps_note)}};
  const double full_fps = pooled(scene.runs(variants::ours)).fps();
  const auto add = [&](std::string name, const Variant& variant) {
    const std::vector<Measurement>& runs = scene.runs(variant);
    const Measurement all = pooled(runs);
    double flat = 0.0;
    for (const Measurement& run : runs) flat = std::max(flat, flatness(run.frame_ms()));
    const auto mean_ms = [&](FrameKind kind) {
      const Summary times = summarize(all.frame_ms(kind));
      return times.count > 0 ? times.mean : Number::nothing;
    };
    table.rows.push_back({std::move(name),
                          {{all.fps()},
                           {all.fps() / full_fps, 2, "×"},
                           {flat, 2},
                           {summarize(all.frame_ms()).p99, 2},
                           {mean_ms(FrameKind::key), 3},
                           {mean_ms(FrameKind::sub), 3},
                           {all.frames_per_key(), 2},
                           {100.0 * all.keys_without_window(), 0, " %"}}});
  };
  add("Ours-Full", variants::ours);
  std::string flags;
  for (const Variant& variant : ablations(scene.options())) {
    add(variant.name, variant);
    flags += fmt::format("{}{}: {}", flags.empty() ? "" : ", ", variant.name, variant.flags);
    if (variant.flags == "--no-split" &&
        tasks(scene.runs(variants::ours)) == tasks(scene.runs(variant))) {
      table.notes.push_back(scene.label() + ": no tile was split.");
    }
  }
  table.notes.push_back("Flags of `bench`: " + flags + ".");
  table.notes.emplace_back(
      "Flatness: p99 over frames of their time over the median of the 121 around, "
      "of the worst trace.");
  return table;
}

PaperTable stages_table(PaperCase& scene) {
  const Measurement vanilla = pooled(scene.runs(variants::vanilla));
  const Measurement exact = pooled(scene.runs(variants::exact));
  const Measurement paper = pooled(scene.runs(variants::paper));
  const Measurement ours = pooled(scene.runs(variants::ours));
  PaperTable table{
      .title = scene.label(),
      .corner = "Speed-up",
      .rows = {speedups("3DGS", vanilla, vanilla, std::nullopt),
               speedups("Exact", exact, vanilla, std::nullopt),
               speedups("Paper-key", paper, vanilla, FrameKind::key),
               speedups("Paper-sub", paper, vanilla, FrameKind::sub),
               speedups("Ours", ours, vanilla, std::nullopt)},
      .notes = {
          "Mean time of a stage of 3DGS over that of the row. Pre-processing is "
          "project and bin; ∞: takes no time (the paper writes 0*).",
          "What a core does within another stage counts there: tile identification in sorting, "
          "in 3DGS too; on the CPU the keys of 3DGS as well."}};
  for (const PaperStage& stage : paper_stages) table.columns.emplace_back(stage.name);
  return table;
}

PaperTable pruned_table(PaperCase& scene) {
  PaperTable table{.corner = "Average FPS",
                   .rows = {{"Size (10³)", {}}, {"3DGS", {}}, {"Exact", {}}, {"Ours", {}}},
                   .notes = {std::string(fps_note),
                             "Pruned as by convert --keep-fraction: what is kept has the largest "
                             "opacity times projected area, the mean over all directions."}};
  const auto add = [&table](PaperCase& kept, double fraction) {
    const double thousands = 1e-3 * static_cast<double>(kept.setup().cloud->size());
    add_column(table, fmt::format("{} {:g} %", kept.label(), 100.0 * fraction),
               {{thousands},
                fps(kept, variants::vanilla),
                fps(kept, variants::exact),
                fps(kept, variants::ours)});
  };
  for (const double fraction : scene.options().keep_fractions) {
    if (fraction == 1.0) {
      add(scene, fraction);
    } else {
      PaperCase kept = scene.pruned(fraction);
      add(kept, fraction);
    }
  }
  return table;
}

}  // namespace catgs
