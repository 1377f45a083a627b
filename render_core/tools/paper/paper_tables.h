#pragma once

#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "render_core/tools/bench/bench_quality.h"
#include "render_core/tools/paper/paper_case.h"
#include "render_core/tools/table.h"

namespace catgs {

// The tables and figures of the paper. Each measures one scene at a time, so that only one is in
// memory. Numbers are means over the frames of all its traces.

PaperTable fps_table(PaperCase& scene);       // Tab. 1
PaperTable quality_table(PaperCase& scene);   // Tab. 2: against photographs, or the exact pipeline
PaperTable ablation_table(PaperCase& scene);  // Tab. 3
PaperTable stages_table(PaperCase& scene);    // Tab. 4
PaperTable list_table(PaperCase& scene);      // Tab. 5
PaperTable window_table(PaperCase& scene);    // appendix: window size
PaperTable tiles_table(PaperCase& scene);     // Fig. 3: load of the tiles
PaperTable pruned_table(PaperCase& scene);    // appendix: pruned scenes

// Not in the paper.
PaperTable traces_table(PaperCase& scene);   // each trace alone, with its quality
PaperTable scaling_table(PaperCase& scene);  // one view of scenes of several sizes

/// The tables by their names in --table, with the way to join those of several scenes.
struct PaperTableKind {
  std::string_view name;
  std::string_view about;
  PaperTable (*measure)(PaperCase& scene);
  std::vector<PaperTable> (*combine)(std::vector<PaperTable> of_scenes);
  bool of_the_paper;  // printed by `all`
};
std::span<const PaperTableKind> paper_table_kinds();

/// The row of fps_table() after which rows measured elsewhere are added.
inline constexpr std::size_t fps_baseline_row = 1;

/// Ratio of the length of key frames' lists to those of the exact pipeline at the same poses, over
/// the key frames that `counts` accepts. NaN when there are none. The runs are of the same traces.
double key_list_growth(const std::vector<Measurement>& keys, const std::vector<Measurement>& exact,
                       const std::function<bool(const FrameStats&)>& counts);

}  // namespace catgs
