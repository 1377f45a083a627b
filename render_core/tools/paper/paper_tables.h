#pragma once

#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "render_core/tools/bench/bench_quality.h"
#include "render_core/tools/paper/paper_case.h"
#include "render_core/tools/table.h"

namespace catgs {

// The tables and figures of the paper. Each measures one scene at a time, so that one scene is in
// memory; numbers are means over the frames of all its traces.

PaperTable fps_table(PaperCase& scene);       // Tab. 1
PaperTable quality_table(PaperCase& scene);   // Tab. 2: against photographs, or the exact pipeline
PaperTable ablation_table(PaperCase& scene);  // Tab. 3
PaperTable stages_table(PaperCase& scene);    // Tab. 4
PaperTable list_table(PaperCase& scene);      // Tab. 5
PaperTable window_table(PaperCase& scene);    // appendix: window size
PaperTable tiles_table(PaperCase& scene);     // Fig. 3: load of the tiles
PaperTable pruned_table(PaperCase& scene);    // appendix: pruned scenes

// Not in the paper.
PaperTable traces_table(PaperCase& scene);   // each trace by itself, with its quality
PaperTable scaling_table(PaperCase& scene);  // one view of scenes of several sizes
PaperTable floor_table(PaperCase& scene);    // stages beside what bytes and evaluations allow

/// Which are told by --table, and how the tables of several scenes become one.
struct PaperTableKind {
  std::string_view name;
  std::string_view about;
  PaperTable (*measure)(PaperCase& scene);
  std::vector<PaperTable> (*combine)(std::vector<PaperTable> of_scenes);
  bool of_the_paper;  // so that `all` prints it
};
std::span<const PaperTableKind> paper_table_kinds();

/// Row of fps_table() that rows measured elsewhere stand behind.
inline constexpr std::size_t fps_baseline_row = 1;

/// How much longer the lists of key frames are than those of the exact pipeline at the same poses;
/// over the key frames that `counts` takes. NaN when there are none. The runs are of the same
/// traces.
double key_list_growth(const std::vector<Measurement>& keys, const std::vector<Measurement>& exact,
                       const std::function<bool(const FrameStats&)>& counts);

}  // namespace catgs
