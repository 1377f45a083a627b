// catgs-render paper: the tables and figures of the paper, for any scenes and traces.
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/build_info.h"
#include "render_core/base/error.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/json_report.h"
#include "render_core/tools/paper/paper_tables.h"

namespace catgs {
namespace {

using Json = nlohmann::ordered_json;

struct PaperCommand {
  PaperOptions options;
  std::vector<std::string> tables;
  std::string baseline;
  std::string json;
};

std::vector<PaperTable> side_by_side(std::vector<PaperTable> of_scenes) {
  return {joined(of_scenes)};
}

std::vector<PaperTable> one_each(std::vector<PaperTable> of_scenes) { return of_scenes; }

std::vector<PaperTable> mean_first(std::vector<PaperTable> of_scenes) {
  if (of_scenes.size() > 1) of_scenes.insert(of_scenes.begin(), averaged(of_scenes));
  return of_scenes;
}

/// The first column of all scenes side by side, explained by the first note; then all columns of
/// each scene.
std::vector<PaperTable> first_column_first(std::vector<PaperTable> of_scenes) {
  std::vector<PaperTable> first = of_scenes;
  for (PaperTable& table : first) {
    table.corner = table.columns.front();
    table.columns = {std::exchange(table.title, {})};
    table.notes.resize(1);
    for (PaperTable::Row& row : table.rows) row.numbers.resize(1);
  }
  of_scenes.insert(of_scenes.begin(), joined(first));
  return of_scenes;
}

/// All scenes side by side, then their growth relative to the first scene.
std::vector<PaperTable> growing(std::vector<PaperTable> of_scenes) {
  PaperTable all = joined(of_scenes);
  const std::vector<PaperTable::Row> rows = all.rows;
  for (const PaperTable::Row& row : rows) {
    if (!row.name.starts_with("In view") && !row.name.ends_with("frame ms")) continue;
    PaperTable::Row& growth = all.rows.emplace_back(
        PaperTable::Row{row.name.substr(0, row.name.rfind(' ')) + " over the first", {}});
    for (const Number& number : row.numbers) {
      growth.numbers.push_back({number.value / row.numbers.front().value, 3, "×"});
    }
  }
  return {all};
}

std::vector<const PaperTableKind*> chosen_kinds(const std::vector<std::string>& names) {
  std::vector<const PaperTableKind*> kinds;
  for (const PaperTableKind& kind : paper_table_kinds()) {
    const bool all = std::ranges::find(names, "all") != names.end();
    if ((all && kind.of_the_paper) || std::ranges::find(names, kind.name) != names.end())
      kinds.push_back(&kind);
  }
  return kinds;
}

/// Rows of fps_table() for the columns `labels`.
Json read_baseline(const std::string& path, const std::vector<std::string>& labels) {
  std::ifstream file(path);
  if (!file) throw InputError(path, "", "cannot be read");
  Json baseline;
  try {
    baseline = Json::parse(file);
  } catch (const Json::parse_error& error) {
    throw InputError(path, fmt::format("byte {}", error.byte), "is not JSON");
  }
  PaperTable unmeasured;  // a mistake appears before anything is measured
  unmeasured.columns = labels;
  unmeasured.rows = {{"", std::vector<Number>(labels.size())}};
  add_rows(unmeasured, 0, baseline, path);
  return baseline;
}

/// Adds the ratio of our pipeline to the fastest row of `baseline`, where that has a number.
void add_lead(PaperTable& fps, const Json& baseline) {
  PaperTable::Row lead{"Ours over the best of these", {}};
  for (std::size_t c = 0; c < fps.columns.size(); ++c) {
    double best = Number::nothing, ours = Number::nothing;
    for (const PaperTable::Row& row : fps.rows) {
      if (row.name == variants::ours.name) ours = row.numbers[c].value;
      if (baseline.contains(row.name)) best = std::fmax(best, row.numbers[c].value);
    }
    lead.numbers.push_back({ours / best, 2, "×"});
  }
  fps.rows.push_back(std::move(lead));
}

/// Whether a table follows the photographs' cameras instead of traces.
bool is_of_photographs(const PaperOptions& options, const PaperTableKind& kind) {
  return kind.name == "quality" && !options.images.empty();
}

/// Options that concern some tables only. Without these tables they would be ignored silently.
void refuse_unused(const CLI::App& app, const PaperOptions& options,
                   const std::vector<const PaperTableKind*>& kinds) {
  struct Use {
    const char* option;
    std::vector<std::string_view> tables;
  };
  static const std::array<Use, 8> uses = {{{"--baseline", {"fps"}},
                                           {"--images", {"quality"}},
                                           {"--image-rate", {"quality"}},
                                           {"--image-folder", {"quality"}},
                                           {"--llffhold", {"quality"}},
                                           {"--keep-fraction", {"pruned"}},
                                           {"--variant", {"ablation"}},
                                           {"--every", {"quality", "tiles", "traces"}}}};
  for (const Use& use : uses) {
    const bool used = std::ranges::any_of(kinds, [&](const PaperTableKind* kind) {
      if (use.option == std::string_view("--every") && is_of_photographs(options, *kind))
        return false;  // --llffhold chooses
      return std::ranges::find(use.tables, kind->name) != use.tables.end();
    });
    if (used || app.count(use.option) == 0) continue;
    throw InputError(use.option, "", "has no effect on the requested tables",
                     fmt::format("it belongs to --table {}", fmt::join(use.tables, ", ")));
  }
}

/// Every table follows traces, except that of photographs.
void require_traces(const PaperOptions& options, const std::vector<std::string>& labels,
                    const std::vector<const PaperTableKind*>& kinds) {
  for (const PaperTableKind* kind : kinds) {
    if (is_of_photographs(options, *kind)) continue;
    for (std::size_t i = 0; i < options.cases.size(); ++i) {
      if (options.cases[i].size() > 1) continue;
      throw InputError("--case", labels[i], "has no trace", "name one or more after the scene");
    }
  }
}

Json case_json(const PaperCase& scene, const std::vector<std::string>& files) {
  const RenderSetup& setup = scene.setup();
  return {{"name", scene.label()},
          {"scene", setup.scene.name},
          {"gaussians", setup.gaussians()},
          {"sh_degree", setup.cloud->sh_degree},
          {"hash", setup.hash()},
          {"traces", std::vector<std::string>(files.begin() + 1, files.end())},
          {"device", setup.made.renderer->description()},
          {"near", setup.camera.near_z}};
}

Json settings_json(const PaperCase& scene) {
  const RenderSetup& setup = scene.setup();
  const SpeculationSettings& speculation = setup.view.speculation;
  const bool scripted = has_script(scene.options());
  const ScriptOptions script = script_options(scene.options().render);
  return {{"size_px", {setup.camera.size_px.x, setup.camera.size_px.y}},
          {"focal_px", setup.camera.focal_px.x},
          {"fps", scene.options().render.fps ? Json(*scene.options().render.fps) : Json()},
          {"seed", scripted ? Json(script.seed) : Json()},
          {"duration_s", scripted ? Json(script.duration_s) : Json()},
          {"anchor", scene.options().render.anchor},
          {"frames", scene.options().render.frames},
          {"window", speculation.initial_window},
          {"max_trail_px", speculation.max_trail_px},
          {"min_depth", speculation.min_depth},
          {"max_deviation_px", speculation.max_deviation_px},
          {"warmup", scene.options().warmup.value_or(default_warmup)},
          {"every", scene.options().every}};
}

/// The scores of each photograph, in the form of the original's per_view.json.
void add_photos(const std::vector<JudgedPhoto>& photos, Json& scene) {
  for (const JudgedPhoto& photo : photos) {
    scene["photographs_px"][photo.name] = {photo.size_px.x, photo.size_px.y};
    for (const auto& [row, score] : photo.rows) {
      scene["per_view"][row]["PSNR"][photo.name] = score.psnr;
      scene["per_view"][row]["SSIM"][photo.name] = score.ssim;
    }
  }
}

/// The data that should accompany a table wherever it is copied. Photographs are compared at their
/// own sizes.
std::string provenance(const Json& report, const std::vector<JudgedPhoto>& photos) {
  const Json& settings = report["settings"];
  std::string sizes;
  if (!settings["size_px"].is_null()) {
    sizes = fmt::format("{}x{}, focal length {} px", settings["size_px"][0].get<int>(),
                        settings["size_px"][1].get<int>(), settings["focal_px"].get<float>());
  }
  if (!photos.empty())
    sizes += fmt::format("{}photographs at {}, focal lengths of COLMAP", sizes.empty() ? "" : "; ",
                         sizes_of(photos));
  return fmt::format("{}, {}; version {}, commit {}.\n", sizes,
                     report["cases"][0]["device"].get<std::string>(), build_version, build_commit);
}

void paper(const PaperCommand& command, const CLI::App& app) {
  const PaperOptions& options = command.options;
  const bool quiet = is_quiet(app);
  const auto kinds = chosen_kinds(command.tables);
  refuse_unused(app, options, kinds);
  check(options);
  const std::vector<std::string> labels = case_labels(options.cases);
  require_traces(options, labels, kinds);
  check_json(command.json);
  const Json baseline = command.baseline.empty() ? Json() : read_baseline(command.baseline, labels);
  Json report = {{"version", build_version}, {"commit", build_commit}, {"cases", Json::array()}};
  std::vector<std::vector<PaperTable>> parts(kinds.size());  // [kind][case]
  std::vector<JudgedPhoto> all_photos;
  for (std::size_t i = 0; i < options.cases.size(); ++i) {
    PaperCase scene(options, i, labels[i], quiet);
    if (!quiet) {
      fmt::print(stderr, "{}: {} ({})\n", scene.label(), scene.setup().made.renderer->description(),
                 scene.setup().made.reason);
    }
    report["cases"].push_back(case_json(scene, options.cases[i]));
    report["settings"] = settings_json(scene);
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      parts[k].push_back(kinds[k]->measure(scene));
    }
    add_photos(scene.photos, report["cases"].back());
    all_photos.insert(all_photos.end(), scene.photos.begin(), scene.photos.end());
  }
  const bool photos_only = std::ranges::all_of(
      kinds, [&](const PaperTableKind* kind) { return is_of_photographs(options, *kind); });
  if (photos_only) report["settings"]["size_px"] = report["settings"]["focal_px"] = nullptr;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const PaperTableKind& kind = *kinds[k];
    std::vector<PaperTable> tables = kind.combine(std::move(parts[k]));
    if (!baseline.is_null() && kind.name == "fps") {
      add_rows(tables[0], fps_baseline_row, baseline, command.baseline);
      add_lead(tables[0], baseline);
    }
    if (command.json != "-") fmt::print("{}## {}\n\n", k == 0 ? "" : "\n", kind.about);
    Json& json = report["tables"][std::string(kind.name)] = Json::array();
    for (std::size_t t = 0; t < tables.size(); ++t) {
      if (command.json != "-") fmt::print("{}{}", t == 0 ? "" : "\n", markdown(tables[t]));
      json.push_back(to_json(tables[t]));
    }
  }
  if (command.json != "-") fmt::print("\n{}", provenance(report, all_photos));
  if (!command.json.empty()) write_json(command.json, report);
}

void add_photograph_options(CLI::App& command, PaperOptions& options) {
  auto* images = command.add_option("--images", options.images,
                                    "quality: compare with the photographs (PNG or JPEG) of a "
                                    "COLMAP folder, one per case, each at "
                                    "its own size. --json lists the scores of each");
  command
      .add_option("--image-folder", options.image_folder,
                  "quality: folder of the photographs in the COLMAP folder, like images_4")
      ->needs(images)
      ->capture_default_str();
  command
      .add_option("--llffhold", options.llffhold,
                  "quality: one photograph in N, by name, is a test view, as in the original "
                  "3DGS; 1 compares all")
      ->needs(images)
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      .add_option("--image-rate", options.image_rate_hz,
                  "quality: photographs per second of the video that they come from")
      ->needs(images)
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
}

}  // namespace

std::span<const PaperTableKind> paper_table_kinds() {
  static constexpr std::array<PaperTableKind, 10> kinds = {
      {{"fps", "Average frame rate", fps_table, side_by_side, true},
       {"quality", "Render quality", quality_table, side_by_side, true},
       {"ablation", "Impact of the major mechanisms", ablation_table, first_column_first, true},
       {"stages", "Acceleration of the stages over 3DGS", stages_table, mean_first, true},
       {"list", "Length of the tile lists", list_table, side_by_side, true},
       {"window", "Impact of the window", window_table, one_each, true},
       {"tiles", "Distribution of the load over tiles", tiles_table, side_by_side, true},
       {"pruned", "Frame rate on pruned scenes", pruned_table, side_by_side, true},
       {"traces", "Each trace alone", traces_table, one_each, false},
       {"scaling", "One view of scenes of several sizes", scaling_table, growing, false}}};
  return kinds;
}

void add_paper_command(CLI::App& app) {
  auto command = std::make_shared<PaperCommand>();
  PaperOptions& options = command->options;
  CLI::App* paper_app = app.add_subcommand(
      "paper", "Prints the tables of the paper, as Markdown, for any scenes and traces");
  std::vector<std::string> names;
  for (const PaperTableKind& kind : paper_table_kinds()) names.emplace_back(kind.name);
  names.emplace_back("all");
  paper_app
      ->add_option("--table", command->tables,
                   "One or more tables, separated by commas; all: those of the paper")
      ->required()
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember(names));
  paper_app
      ->add_option(
          "--case", options.cases,
          "A scene, then its traces: camera paths (see frames --help) or scripts (orbit, walk, "
          "head, drone, still, tour:FILE). Repeat it to add a column for another scene")
      ->required()
      ->type_name("SCENE TRACE...");
  add_photograph_options(*paper_app, options);
  paper_app->add_option(
      "--baseline", command->baseline,
      "fps: add rows measured elsewhere, JSON {\"FlashGS\": {\"city\": 120.5}}, and the ratio "
      "of ours to the best of them");
  paper_app
      ->add_option("--keep-fraction", options.keep_fractions,
                   "pruned: shares of the Gaussians (1,0.5,0.25)")
      ->delimiter(',')
      ->allow_extra_args(false);
  paper_app
      ->add_option("--variant", options.variants,
                   "ablation: add a row for the paper's pipeline with these flags of bench, like "
                   "\"--window 8\"")
      ->allow_extra_args(false);
  paper_app->add_flag("--anchor", options.render.anchor,
                      "Move the traces to the start pose of their scene");
  add_frame_options(*paper_app, options.render);
  add_speculation_options(*paper_app, options.render.pipeline);
  paper_app->add_option("--warmup", options.warmup,
                        fmt::format("Frames rendered before measuring ({})", default_warmup));
  paper_app
      ->add_option("--every", options.every,
                   "quality, tiles, traces: judge one frame in N of a trace")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  paper_app->add_option("--json", command->json,
                        "Also write the tables to this file; - prints JSON instead");
  paper_app->callback([command, paper_app] { paper(*command, *paper_app); });
}

}  // namespace catgs
