// catgs-render convert: reads a scene and writes it in another format.
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/scene/files/hints.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/scene/files/scene_parts.h"
#include "render_core/scene/prune.h"
#include "render_core/scene/scene.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/render/tree_output.h"
#include "render_core/tools/scene_options.h"

namespace catgs {
namespace {

struct ConvertOptions {
  SceneOptions in;
  std::string out;
  double keep_fraction = 1.0;
  int threads = 0;
  TreeOptions tree;
};

/// Estimated hints can be estimated again. Others would be lost with the files that they came from.
void write_hints_beside(const SceneHints& hints, const std::filesystem::path& out) {
  if (hints.source.empty() || hints.source == "estimated") return;
  const auto sidecar = sidecar_of(out);
  if (std::error_code error; std::filesystem::exists(sidecar, error)) {
    fmt::print(stderr, "note: {} exists and was left as it is\n", sidecar.string());
    return;
  }
  write_sidecar(hints, sidecar);
  fmt::print("{}: first view, from {}\n", sidecar.string(), hints.source);
}

/// Before the scene is loaded, which may take minutes.
void check_output(const ConvertOptions& options) {
  if (!is_tree_name(options.out)) check_can_be_saved(options.out);
  if (std::error_code error; std::filesystem::equivalent(options.in.path, options.out, error))
    throw InputError(options.out, "", "is the scene that is read", "give the output another name");
}

void print_notes(const std::vector<std::string>& notes) {
  for (const std::string& note : notes) fmt::print(stderr, "note: {}\n", printable(note));
}

/// Writes a tree without holding the scene, if its format allows that.
bool convert_in_parts(const ConvertOptions& options, bool quiet) {
  if (!is_tree_name(options.out) || options.keep_fraction < 1.0) return false;
  if (options.in.lod || options.in.budget) return false;
  const auto pool = std::make_shared<ThreadPool>(options.threads);
  LoadOptions load;
  load.up = up_of(options.in);
  load.model = model_of(options.in);
  const auto scene = scene_in_parts(options.in.path, load, pool);
  if (!scene) return false;
  write_tree(scene->parts, options.tree, options.out, *pool, quiet);
  print_notes(scene->notes);
  write_hints_beside(scene->hints, options.out);
  return true;
}

void save(const Scene& scene, const ConvertOptions& options, bool quiet) {
  if (!is_tree_name(options.out)) return save_scene(scene.cloud, options.out, options.threads);
  ThreadPool pool(options.threads);
  const SceneParts whole{[&](const auto& take) {
                           take(scene.cloud);
                           return std::uint64_t{scene.report.dropped};
                         },
                         scene.format, true};
  write_tree(whole, options.tree, options.out, pool, quiet);
}

void convert(const ConvertOptions& options, bool quiet) {
  if (!(options.keep_fraction > 0.0 && options.keep_fraction <= 1.0))
    throw InputError("--keep-fraction", "",
                     fmt::format("{} is not in (0, 1]", options.keep_fraction));
  check_output(options);
  if (convert_in_parts(options, quiet)) return;
  constexpr bool first_view = false;  // would be estimated anew from the file that is written
  Scene scene = load_scene(options.in, options.threads, quiet, first_view);
  const std::size_t loaded = scene.cloud.size();
  keep_most_important(scene.cloud, options.keep_fraction);
  save(scene, options, quiet);
  fmt::print("{}: {} of {} Gaussians, {:.1f} MB, from {}\n", options.out, scene.cloud.size(),
             scene.report.read, 1e-6 * static_cast<double>(std::filesystem::file_size(options.out)),
             scene.format);
  if (scene.report.dropped > 0)
    fmt::print("{} could not be drawn and were dropped (catgs-render info says why)\n",
               scene.report.dropped);
  if (scene.cloud.size() < loaded)
    fmt::print("{} least important Gaussians were pruned\n", loaded - scene.cloud.size());
  print_notes(scene.notes);
  if (!keeps_model(options.out, scene.cloud.model))
    fmt::print(stderr, "note: {} cannot tell its model; write \"model\": \"{}\" into {}\n",
               options.out, name_of(scene.cloud.model), sidecar_of(options.out).string());
  write_hints_beside(scene.hints, options.out);
}

}  // namespace

void add_convert_command(CLI::App& app) {
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* command =
      app.add_subcommand("convert", "Converts a scene to .ply, .splat, .spz, .sog, .glb or .tree");
  add_scene_options(*command, options->in, "in");
  command->add_option("out", options->out, "File to write: .ply, .splat, .spz, .sog, .glb or .tree")
      ->required();
  command
      ->add_option(
          "--keep-fraction", options->keep_fraction,
          "Keep the most important share of the Gaussians, by opacity times mean projected area")
      ->capture_default_str();
  command->add_option("--threads", options->threads, "Number of threads; 0: one per processor")
      ->capture_default_str();
  add_tree_options(*command, options->tree);
  command->callback([options, command] { convert(*options, is_quiet(*command)); });
}

}  // namespace catgs
