#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/tools/bench_measure.h"
#include "render_core/tools/render_setup.h"

namespace catgs {

struct PaperOptions {
  RenderOptions render;                         // its scene and path are those of the cases
  std::vector<std::vector<std::string>> cases;  // scene, traces…
  std::vector<std::string> images;              // COLMAP folders, one per case, or none at all
  double image_rate_hz = 30.0;                  // photographs per second
  std::size_t warmup = 10;
  std::size_t every = 10;  // quality and tiles look at one frame in so many
  std::vector<double> keep_fractions = {1.0, 0.5, 0.25};
};

/// The renderers that the tables compare.
enum class Variant {
  vanilla,        // "3DGS"
  exact,          // "Exact": precise culling alone
  ours,           // "Ours"
  without_cache,  // "Ours-w/o": every frame is a key frame
  without_split,  // a tile is blended by one block, however long its list is
};
std::string_view variant_name(Variant variant);

/// A scene and its traces, loaded, and what was measured on it so far: several tables use the same
/// runs.
class PaperCase {
 public:
  /// Case `index` of the options, which must outlive it. Throws InputError.
  PaperCase(const PaperOptions& options, std::size_t index, std::string label, bool quiet);

  /// The same case with the most important share of its Gaussians only (scene/prune.h).
  [[nodiscard]] PaperCase pruned(double keep_fraction) const;

  [[nodiscard]] const std::string& label() const { return label_; }
  [[nodiscard]] const PaperOptions& options() const { return *options_; }
  /// The scene; its path is one of the traces inside for_each_trace(), else undefined.
  [[nodiscard]] const RenderSetup& setup() const { return setup_; }
  /// COLMAP folder; "" without one.
  [[nodiscard]] std::string images() const;

  [[nodiscard]] ViewSettings settings(Variant variant) const;

  /// One measurement per trace; of a variant, measured when first asked for. An InputError says
  /// which one the core does not render.
  const std::vector<Measurement>& runs(Variant variant);
  std::vector<Measurement> runs(const ViewSettings& settings, std::string_view name);

  /// Calls visit(index of the trace, progress) with setup() on each trace in turn; `doing` is what
  /// the terminal shows. Throws InputError where the case has no traces.
  using Visit = std::function<void(std::size_t trace, const ProgressReport& report)>;
  void for_each_trace(std::string_view doing, const Visit& visit);

  /// How forecasts are made in what is measured from now on.
  void predict_by(const PredictorSettings& settings) { setup_.predictor = settings; }

  /// Puts setup() on a path of the caller's.
  void follow(Trajectory samples, Trajectory poses, double fps);

  [[nodiscard]] bool quiet() const { return quiet_; }

 private:
  PaperCase(const PaperCase& whole, RenderSetup setup);

  const PaperOptions* options_;
  std::size_t index_;
  std::string label_;
  bool quiet_;
  RenderSetup setup_;
  std::map<Variant, std::vector<Measurement>> runs_;
};

/// All traces as one: the same queries, over all frames.
Measurement pooled(const std::vector<Measurement>& runs);

/// A column's name per case: the scene's, with its traces where that alone would not tell them
/// apart.
std::vector<std::string> case_labels(const std::vector<std::vector<std::string>>& cases);

/// Finds mistakes in the options before a large scene is read: counts, files that are not there.
/// Throws InputError.
void check(const PaperOptions& options);

}  // namespace catgs
