#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/tools/bench/bench_measure.h"
#include "render_core/tools/render_setup.h"

namespace catgs {

struct PaperOptions {
  RenderOptions render;                         // each case sets its scene and path
  std::vector<std::vector<std::string>> cases;  // scene, traces…
  std::vector<std::string> images;              // COLMAP folders, one per case, or none at all
  std::string image_folder = "images";          // of the photographs, in each COLMAP folder
  double image_rate_hz = 30.0;                  // photographs per second
  std::size_t llffhold = 8;                     // one photograph in this many is a test view
  std::optional<std::size_t> warmup;            // as warmup_frames() takes it
  std::size_t every = 10;                       // quality and tiles look at one frame in this many
  std::vector<double> keep_fractions = {1.0, 0.5, 0.25};
  std::vector<std::string> variants;  // flags of additional rows of ablation
};

/// A renderer in the tables: a pipeline, and the flags that tell `bench` to leave out a part of it.
struct Variant {
  std::string name;
  Pipeline pipeline = Pipeline::catgs;
  std::string flags{};
};

namespace variants {
inline const Variant vanilla{"3DGS", Pipeline::vanilla};
inline const Variant exact{"Exact", Pipeline::exact};  // precise culling alone
inline const Variant paper{"Paper", Pipeline::paper};  // the published method
inline const Variant ours{"Ours"};
inline const Variant without_cache{"Paper-w/o cache", Pipeline::paper, "--no-cache"};
}  // namespace variants

/// Our pipeline and the paper's with one part at a time left out, and the paper's with the flags of
/// `--variant`. A new part is a line here.
std::vector<Variant> ablations(const PaperOptions& options);

/// A photograph, and how well each row of the table meets it.
struct JudgedPhoto {
  struct Score {
    double psnr, ssim;
  };
  std::string name;
  glm::ivec2 size_px;
  std::map<std::string, Score> rows;
};

/// "96x64 px", or the smallest and the largest size where they differ. Needs a photograph.
std::string sizes_of(const std::vector<JudgedPhoto>& photos);

/// A scene and its traces, loaded, and the results measured on it so far: several tables use the
/// same runs.
class PaperCase {
 public:
  /// Case `index` of the options, which must outlive it. Throws InputError.
  PaperCase(const PaperOptions& options, std::size_t index, std::string label, bool quiet);

  /// The same case with the most important share of its Gaussians only (scene/prune.h).
  [[nodiscard]] PaperCase pruned(double keep_fraction) const;

  [[nodiscard]] const std::string& label() const { return label_; }
  [[nodiscard]] const PaperOptions& options() const { return *options_; }
  /// The scene. Inside for_each_trace() its path is that of one trace, elsewhere undefined.
  [[nodiscard]] const RenderSetup& setup() const { return setup_; }
  /// COLMAP folder; "" without one.
  [[nodiscard]] std::string images() const;

  [[nodiscard]] ViewSettings settings(const Variant& variant) const;

  /// One measurement per trace, made for a variant at its first call. The InputError of a variant
  /// that the core does not render names it.
  const std::vector<Measurement>& runs(const Variant& variant);
  std::vector<Measurement> runs(const ViewSettings& settings, std::string_view name);

  /// The name of a trace in tables.
  [[nodiscard]] std::string trace_name(std::size_t trace) const;

  /// Calls visit(index of the trace, progress) with setup() on each trace in turn. The terminal
  /// shows `doing`.
  using Visit = std::function<void(std::size_t trace, const ProgressReport& report)>;
  void for_each_trace(std::string_view doing, const Visit& visit);

  /// Sets how forecasts are made in all later measurements.
  void predict_by(const PredictorSettings& settings) { setup_.predictor = settings; }

  /// Puts setup() on a path of the caller's.
  void follow(Trajectory samples, Trajectory poses, double fps);

  /// The photographs that tables have compared with, in the order of their names.
  std::vector<JudgedPhoto> photos;

  [[nodiscard]] bool quiet() const { return quiet_; }

 private:
  PaperCase(const PaperCase& whole, RenderSetup setup);
  [[nodiscard]] PipelineOptions pipeline_options(const Variant& variant) const;

  const PaperOptions* options_;
  std::size_t index_;
  std::string label_;
  bool quiet_;
  RenderSetup setup_;
  std::map<std::string, std::vector<Measurement>> runs_;  // by the variant's name
};

/// All traces as one: the same queries, over all frames.
Measurement pooled(const std::vector<Measurement>& runs);

/// A column's name per case: that of the scene, with its traces where the scene alone is ambiguous.
std::vector<std::string> case_labels(const std::vector<std::vector<std::string>>& cases);

/// Whether a trace of any case is a script.
bool has_script(const PaperOptions& options);

/// Finds mistakes in the options before a large scene is read, such as counts and missing files.
/// Throws InputError.
void check(const PaperOptions& options);

}  // namespace catgs
