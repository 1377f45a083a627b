// Tables of the paper about time: fps, ablation, stages, pruned.
#include <array>
#include <limits>

#include <fmt/format.h>

#include "render_core/tools/paper_tables.h"

namespace catgs {
namespace {

Number fps(PaperCase& scene, Variant variant) { return {pooled(scene.runs(variant)).fps()}; }

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

/// The stages as the paper counts them. It times finding the lists' ranges apart; our cores do that
/// while they sort, and so in the baseline too.
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
  const Number vanilla = fps(scene, Variant::vanilla), ours = fps(scene, Variant::ours);
  return {.title = {},
          .corner = "Average FPS",
          .columns = {scene.label()},
          .rows = {{"Model size", {{static_cast<double>(scene.setup().cloud->size()), 0}}},
                   {"3DGS", {vanilla}},
                   {"Exact", {fps(scene, Variant::exact)}},
                   {"Ours-w/o", {fps(scene, Variant::without_cache)}},
                   {"Ours", {ours}},
                   {"Ours over 3DGS", {{ours.value / vanilla.value, 2, "×"}}}},
          .notes = {std::string(fps_note),
                    "Model size: Gaussians. Exact: precise culling alone. Ours-w/o: without the "
                    "caches between frames, every frame is a key frame."}};
}

PaperTable ablation_table(PaperCase& scene) {
  PaperTable table{.title = {},
                   .corner = "Average FPS",
                   .columns = {scene.label()},
                   .rows = {{"Ours-Full", {fps(scene, Variant::ours)}},
                            {"Ours-w/o cache", {fps(scene, Variant::without_cache)}},
                            {"Ours-w/o split", {fps(scene, Variant::without_split)}}},
                   .notes = {std::string(fps_note)}};
  if (tasks(scene.runs(Variant::ours)) == tasks(scene.runs(Variant::without_split))) {
    table.notes.push_back(scene.label() + ": no tile was split.");
  }
  return table;
}

PaperTable stages_table(PaperCase& scene) {
  const Measurement vanilla = pooled(scene.runs(Variant::vanilla));
  const Measurement exact = pooled(scene.runs(Variant::exact));
  const Measurement ours = pooled(scene.runs(Variant::ours));
  PaperTable table{
      .title = scene.label(),
      .corner = "Speed-up",
      .columns = {},
      .rows = {speedups("3DGS", vanilla, vanilla, std::nullopt),
               speedups("Exact", exact, vanilla, std::nullopt),
               speedups("Ours-key", ours, vanilla, FrameKind::key),
               speedups("Ours-sub", ours, vanilla, FrameKind::sub)},
      .notes = {
          "Mean time of a stage of 3DGS over that of the row. Pre-processing is "
          "project and bin; ∞: takes no time (the paper writes 0*).",
          "What a core does within another stage counts there: tile identification in sorting, "
          "in 3DGS too; on the CPU the keys of 3DGS as well."}};
  for (const PaperStage& stage : paper_stages) table.columns.emplace_back(stage.name);
  return table;
}

PaperTable pruned_table(PaperCase& scene) {
  PaperTable table{.title = {},
                   .corner = "Average FPS",
                   .columns = {},
                   .rows = {{"Size (10³)", {}}, {"3DGS", {}}, {"Exact", {}}, {"Ours", {}}},
                   .notes = {std::string(fps_note),
                             "Pruned as by convert --keep-fraction: what is kept has the largest "
                             "opacity times projected area, the mean over all directions."}};
  const auto add = [&table](PaperCase& kept, double fraction) {
    table.columns.push_back(fmt::format("{} {:g} %", kept.label(), 100.0 * fraction));
    const double thousands = 1e-3 * static_cast<double>(kept.setup().cloud->size());
    const std::array<Number, 4> column = {Number{thousands}, fps(kept, Variant::vanilla),
                                          fps(kept, Variant::exact), fps(kept, Variant::ours)};
    for (std::size_t i = 0; i < column.size(); ++i) table.rows[i].numbers.push_back(column[i]);
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
