#pragma once

#include <optional>

#include <nlohmann/json_fwd.hpp>

#include "render_core/tools/bench/bench_measure.h"
#include "render_core/tools/bench/bench_quality.h"

namespace catgs {

/// The results of `bench`, and what they are about.
struct BenchResult {
  ViewSettings settings;
  std::size_t warmup = 0;
  std::size_t views = 1;
  Measurement measurement;
  PairCost pair_cost;
  std::optional<QualityReport> quality;

  /// Time of everything before the blend, per Gaussian of the scene.
  [[nodiscard]] double ns_per_gaussian(const RenderSetup& setup) const;
};

/// The report of `catgs-render bench`. Fields that end in _key and _sub repeat a field for key and
/// sub-frames; they are null where there are none. JSON has no infinity, so null stands for the
/// PSNR of identical pictures.
nlohmann::ordered_json report_json(const RenderOptions& options, const RenderSetup& setup,
                                   const BenchResult& result);

/// The same for people, on stdout.
void print_report(const RenderSetup& setup, const BenchResult& result);

}  // namespace catgs
