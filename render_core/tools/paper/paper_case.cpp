#include "render_core/tools/paper/paper_case.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/prune.h"
#include "render_core/tools/progress.h"

namespace catgs {
namespace {

bool is_script(std::string_view trace) {
  constexpr std::array<std::string_view, 5> scripts = {"orbit", "walk", "head", "drone", "still"};
  return trace.starts_with("tour:") || std::ranges::find(scripts, trace) != scripts.end();
}

/// The render options of one trace of a case.
RenderOptions with_trace(RenderOptions options, const std::string& trace) {
  (is_script(trace) ? options.script : options.trace) = trace;
  return options;
}

std::string stem(const std::string& file) {
  std::filesystem::path path(file);
  // A scene of many files is named by its folder.
  if (is_scene_index(path)) path = path.parent_path();
  return (path.has_filename() ? path : path.parent_path()).stem().string();
}

RenderSetup load_case(const PaperOptions& options, std::size_t index, bool quiet) {
  RenderOptions render = options.render;
  render.scene.path = options.cases[index].front();
  render.pipeline.pipeline = pipeline_name(Pipeline::paper);
  return prepare_scene(render, quiet);
}

}  // namespace

std::vector<Variant> ablations(const PaperOptions& options) {
  std::vector<Variant> all = {
      {"Ours-w/o colour cache", Pipeline::catgs, "--no-colour-cache"},
      {"Ours-w/o split", Pipeline::catgs, "--no-split"},
      variants::paper,
      variants::without_cache,
      {"Paper-w/o doubt", Pipeline::paper, "--constant-velocity"},
  };
  for (const std::string& flags : options.variants) {
    all.push_back({"Paper " + flags, Pipeline::paper, flags});
  }
  return all;
}

std::string sizes_of(const std::vector<JudgedPhoto>& photos) {
  const auto [low, high] = std::ranges::minmax(photos, {}, [](const JudgedPhoto& photo) {
    return std::int64_t{photo.size_px.x} * photo.size_px.y;
  });
  const auto text = [](glm::ivec2 size) { return fmt::format("{}x{}", size.x, size.y); };
  return low.size_px == high.size_px
             ? text(low.size_px) + " px"
             : fmt::format("{} to {} px", text(low.size_px), text(high.size_px));
}

PaperCase::PaperCase(const PaperOptions& options, std::size_t index, std::string label, bool quiet)
    : options_(&options),
      index_(index),
      label_(std::move(label)),
      quiet_(quiet),
      setup_(load_case(options, index, quiet)) {
  const std::vector<std::string>& files = options.cases[index];
  for (std::size_t i = 1; i < files.size(); ++i) {  // mistakes appear before anything is measured
    set_path(setup_, with_trace(options.render, files[i]));
    (void)warmup_frames(options.warmup, setup_);
  }
}

PaperCase::PaperCase(const PaperCase& whole, RenderSetup setup)
    : options_(whole.options_),
      index_(whole.index_),
      label_(whole.label_),
      quiet_(whole.quiet_),
      setup_(std::move(setup)) {}

PaperCase PaperCase::pruned(double keep_fraction) const {
  GaussianCloud cloud = setup_.whole_cloud("--table pruned");
  keep_most_important(cloud, keep_fraction);
  RenderSetup setup;
  setup.scene = setup_.scene;  // with the whole scene's hints, so that paths stay the same
  setup.cloud = std::make_shared<const GaussianCloud>(std::move(cloud));
  setup.pool = setup_.pool;
  setup.view = setup_.view;
  setup.predictor = setup_.predictor;
  setup.camera = setup_.camera;
  RendererOptions core = renderer_options(options_->render);
  core.pool = setup.pool;
  setup.made = make_renderer(setup.cloud, core);
  return {*this, std::move(setup)};
}

std::string PaperCase::images() const {
  return options_->images.empty() ? std::string() : options_->images[index_];
}

/// The command's options of the paper's pipeline are for its rows alone.
PipelineOptions PaperCase::pipeline_options(const Variant& variant) const {
  PipelineOptions options;
  if (variant.pipeline == Pipeline::paper) options = options_->render.pipeline;
  options.pipeline = pipeline_name(variant.pipeline);
  return with_flags(options, variant.flags);
}

ViewSettings PaperCase::settings(const Variant& variant) const {
  return view_settings(pipeline_options(variant));
}

const std::vector<Measurement>& PaperCase::runs(const Variant& variant) {
  auto known = runs_.find(variant.name);
  if (known == runs_.end()) {
    const PredictorSettings usual = setup_.predictor;
    setup_.predictor.min_confidence = predictor_settings(pipeline_options(variant)).min_confidence;
    known = runs_.emplace(variant.name, runs(settings(variant), variant.name)).first;
    setup_.predictor = usual;
  }
  return known->second;
}

std::vector<Measurement> PaperCase::runs(const ViewSettings& settings, std::string_view name) {
  std::vector<Measurement> runs;
  try {
    for_each_trace(name, [&](std::size_t, const ProgressReport& report) {
      const std::size_t warmup = warmup_frames(options_->warmup, setup_);
      runs.push_back(measure(setup_, settings, warmup, report));
    });
  } catch (const InputError& error) {
    throw InputError(label_, fmt::format("{} ({})", name, pipeline_name(settings.pipeline)),
                     error.what());
  }
  return runs;
}

std::string PaperCase::trace_name(std::size_t trace) const {
  return stem(options_->cases[index_][trace + 1]);
}

void PaperCase::for_each_trace(std::string_view doing, const Visit& visit) {
  const std::vector<std::string>& files = options_->cases[index_];
  for (std::size_t i = 1; i < files.size(); ++i) {
    set_path(setup_, with_trace(options_->render, files[i]));
    Progress progress(fmt::format("{}: {}, {}", label_, doing, trace_name(i - 1)), quiet_);
    visit(i - 1, [&](double fraction) { progress.update(fraction); });
  }
}

void PaperCase::follow(Trajectory samples, Trajectory poses, double fps) {
  setup_.samples = std::move(samples);
  setup_.poses = std::move(poses);
  setup_.first = 0;
  setup_.fps = fps;
}

Measurement pooled(const std::vector<Measurement>& runs) {
  Measurement all;
  for (const Measurement& run : runs) {
    all.frames.insert(all.frames.end(), run.frames.begin(), run.frames.end());
    all.wall_ms += run.wall_ms;
    all.view_bytes = std::max(all.view_bytes, run.view_bytes);
  }
  return all;
}

std::vector<std::string> case_labels(const std::vector<std::vector<std::string>>& cases) {
  std::vector<std::string> scenes, labels;
  for (const auto& files : cases) scenes.push_back(stem(files.front()));
  for (std::size_t i = 0; i < cases.size(); ++i) {
    std::string label = scenes[i];
    if (std::ranges::count(scenes, label) > 1) {
      for (std::size_t k = 1; k < cases[i].size(); ++k) label.append(" ").append(stem(cases[i][k]));
    }
    const std::string unnumbered = label;
    for (int n = 2; std::ranges::find(labels, label) != labels.end(); ++n) {
      label = fmt::format("{} ({})", unnumbered, n);
    }
    labels.push_back(std::move(label));
  }
  return labels;
}

bool has_script(const PaperOptions& options) {
  return std::ranges::any_of(options.cases, [](const std::vector<std::string>& files) {
    return std::any_of(files.begin() + 1, files.end(), is_script);
  });
}

void check(const PaperOptions& options) {
  const auto require = [](const std::string& path, std::string_view remedy) {
    std::error_code error;
    if (!std::filesystem::exists(path, error)) throw InputError(path, "", "does not exist", remedy);
  };
  for (const auto& files : options.cases) {
    for (const std::string& file : files) {
      if (&file != &files.front() && is_script(file)) continue;
      require(file, "a scene, then its traces, then the next --case");
    }
  }
  if (!options.images.empty() && options.images.size() != options.cases.size()) {
    throw InputError(
        "--images", "",
        fmt::format("{} folders for {} scenes", options.images.size(), options.cases.size()),
        "name one for each --case, in the same order");
  }
  for (const std::string& folder : options.images) {
    require(folder, "--images takes the folder of a COLMAP reconstruction");
  }
  if (!has_script(options)) refuse_script_options(options.render);
  for (const std::string& flags : options.variants) {
    PipelineOptions pipeline = options.render.pipeline;
    pipeline.pipeline = pipeline_name(Pipeline::paper);
    (void)with_flags(pipeline, flags);
  }
  for (const double fraction : options.keep_fractions) {
    if (!(fraction > 0.0 && fraction <= 1.0)) {
      throw InputError("--keep-fraction", "", fmt::format("{} is not in (0, 1]", fraction));
    }
  }
}

}  // namespace catgs
