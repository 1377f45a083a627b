// Tables of the paper about the lists of the tiles: list, tiles.
#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/metrics/summary.h"
#include "render_core/tools/paper/paper_tables.h"

namespace catgs {
namespace {

constexpr double thousand = 1e-3;

/// The loads of tiles in some frames. Tiles are compared within their frame before frames are
/// compared: a busy frame is not a busy tile.
class TileLoads {
 public:
  void add(std::vector<std::uint32_t> loads) {
    std::ranges::sort(loads, std::greater());
    const double total = sum(loads, loads.size());
    tiles_ = loads.size();
    all_.insert(all_.end(), loads.begin(), loads.end());
    total_ += total;
    busiest_ += sum(loads, (loads.size() + 9) / 10);
    const double split_above = 2.0 * total / static_cast<double>(loads.size());
    for (const std::uint32_t load : loads) long_ += static_cast<double>(load) > split_above ? 1 : 0;
  }

  void finish() { std::ranges::sort(all_); }

  [[nodiscard]] double tiles() const { return static_cast<double>(tiles_); }
  [[nodiscard]] double mean() const { return total_ / static_cast<double>(all_.size()); }
  [[nodiscard]] double percentile(double share) const { return catgs::percentile(all_, share); }
  [[nodiscard]] double busiest_percent() const { return 100.0 * busiest_ / total_; }
  [[nodiscard]] double long_percent() const {
    return 100.0 * static_cast<double>(long_) / static_cast<double>(all_.size());
  }

 private:
  static double sum(const std::vector<std::uint32_t>& loads, std::size_t count) {
    double sum = 0.0;
    for (std::size_t i = 0; i < count; ++i) sum += static_cast<double>(loads[i]);
    return sum;
  }

  std::size_t tiles_ = 0;    // of the last frame
  std::vector<double> all_;  // of all frames
  double total_ = 0.0, busiest_ = 0.0;
  std::size_t long_ = 0;
};

/// Adds the column of a variant.
void add_tiles(PaperTable& table, PaperCase& scene, const Variant& variant) {
  TileLoads loads;
  double tasks = 0.0;
  std::size_t frames = 0;
  scene.for_each_trace(variant.name, [&](std::size_t, const ProgressReport& report) {
    const RenderSetup& setup = scene.setup();
    const auto view = setup.made.renderer->make_view(scene.settings(variant));
    for (std::size_t i = 0; i < setup.poses.size(); i += scene.options().every) {
      FrameView frame;
      render_or_throw(*view, setup.request(i), frame);
      std::vector<std::uint32_t> lists = view->tile_loads();
      if (lists.empty()) {
        throw InputError("--table", "tiles",
                         fmt::format("{} does not report the length of its lists",
                                     setup.made.renderer->description()),
                         "use --renderer cpu");
      }
      loads.add(std::move(lists));
      tasks += static_cast<double>(frame.stats.tasks);
      ++frames;
      report(static_cast<double>(i + 1) / static_cast<double>(setup.poses.size()));
    }
  });
  loads.finish();
  const double slices = tasks > 0.0 ? tasks / static_cast<double>(frames) : Number::nothing;
  add_column(table, fmt::format("{} {}", scene.label(), variant.name),
             {{loads.tiles(), 0},
              {loads.mean(), 1},
              {loads.percentile(0.5), 0},
              {loads.percentile(0.9), 0},
              {loads.percentile(0.99), 0},
              {loads.percentile(1.0), 0},
              {loads.busiest_percent(), 1, " %"},
              {loads.long_percent(), 1, " %"},
              {slices, 0}});
}

}  // namespace

double key_list_growth(const std::vector<Measurement>& keys, const std::vector<Measurement>& exact,
                       const std::function<bool(const FrameStats&)>& counts) {
  double longer = 0.0, shorter = 0.0;
  for (std::size_t run = 0; run < keys.size(); ++run) {
    for (std::size_t i = 0; i < keys[run].frames.size(); ++i) {
      const FrameStats& stats = keys[run].frames[i].stats;
      if (stats.kind != FrameKind::key || !counts(stats)) continue;
      longer += static_cast<double>(stats.list_entries);
      shorter += static_cast<double>(exact[run].frames[i].stats.list_entries);
    }
  }
  return shorter > 0.0 ? longer / shorter : Number::nothing;
}

PaperTable list_table(PaperCase& scene) {
  const auto length = [](const Measurement& run, Measurement::Kind kind = std::nullopt) {
    const bool none = run.frame_ms(kind).empty();
    return Number{none ? Number::nothing : thousand * run.list_length(kind).mean};
  };
  const Measurement ours = pooled(scene.runs(variants::ours));
  const Measurement paper = pooled(scene.runs(variants::paper));
  const Measurement vanilla = pooled(scene.runs(variants::vanilla));
  const Measurement exact = pooled(scene.runs(variants::exact));
  const double growth = key_list_growth(scene.runs(variants::paper), scene.runs(variants::exact),
                                        [](const FrameStats&) { return true; });
  PaperTable table{.corner = "List length (10³)",
                   .columns = {scene.label()},
                   .rows = {{"3DGS", {length(vanilla)}},
                            {"Exact", {length(exact)}},
                            {"Paper-key", {length(paper, FrameKind::key)}},
                            {"Paper-sub", {length(paper, FrameKind::sub)}},
                            {"Paper-key over Exact", {{growth, 3, "×"}}},
                            {"Ours", {length(ours)}}},
                   .notes = {"Entries of all tile lists of a frame; a sub-frame uses its key "
                             "frame's. Tiles have 16x16 px; on CUDA, all but those of 3DGS have "
                             "32x32. The growth compares key frames with Exact at the same "
                             "poses."}};
  std::uint64_t overflowed = 0;
  for (const Measurement* run : {&vanilla, &exact, &paper, &ours})
    overflowed += run->list_length().overflowed;
  if (overflowed > 0) {
    table.notes.push_back(fmt::format("{}: {} entries found no memory and are not counted.",
                                      scene.label(), overflowed));
  }
  return table;
}

PaperTable tiles_table(PaperCase& scene) {
  PaperTable table{
      .corner = "Load of the tiles",
      .rows = {{"Tiles", {}},
               {"Mean list", {}},
               {"50 % of the tiles hold at most", {}},
               {"90 %", {}},
               {"99 %", {}},
               {"Longest list", {}},
               {"Share of the busiest 10 %", {}},
               {"Tiles over twice the mean", {}},
               {"Slices", {}}},
      .notes = {fmt::format("List entries per tile, one frame in {}. Tiles have 16x16 px; on CUDA, "
                            "those of Exact have 32x32. Slices: parts in which a frame's tiles are "
                            "blended.",
                            scene.options().every)}};
  add_tiles(table, scene, variants::vanilla);
  add_tiles(table, scene, variants::exact);
  return table;
}

}  // namespace catgs
