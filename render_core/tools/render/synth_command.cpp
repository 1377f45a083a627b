// catgs-render synth: writes a procedural scene and a sidecar with its hints.
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/scene/files/hints.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/synth/synth.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/render/tree_output.h"

namespace catgs {
namespace {

struct SynthOptions {
  std::string kind;
  std::size_t gaussians = 300'000;
  std::uint64_t seed = 1;
  std::string out;
  TreeOptions tree;
};

/// Part by part, so that the scene never is in memory as a whole.
void write_tree(SynthKind kind, const SynthOptions& options, bool quiet) {
  ThreadPool pool;
  SceneHints hints;
  const SceneParts parts{[&](const auto& take) {
                           hints =
                               synthesize_parts(kind, options.gaussians, options.seed, pool, take);
                           return std::uint64_t{0};
                         },
                         "procedural"};
  write_tree(parts, options.tree, options.out, pool, quiet);
  write_sidecar(hints, sidecar_of(options.out));
}

void synth(const SynthOptions& options, bool quiet) {
  const SynthKind kind = parse_synth_kind(options.kind);
  if (is_tree_name(options.out)) return write_tree(kind, options, quiet);
  const Scene scene = synthesize(kind, options.gaussians, options.seed);
  // The sidecar is written first, so that the scene never lacks its start pose.
  write_sidecar(scene.hints, sidecar_of(options.out));
  save_scene(scene.cloud, options.out);
}

}  // namespace

void add_synth_command(CLI::App& app) {
  auto options = std::make_shared<SynthOptions>();
  CLI::App* command = app.add_subcommand("synth", "Writes a procedural scene");
  command->add_option("kind", options->kind, "Kind of scene: city, garden or stress")->required();
  command
      ->add_option("out", options->out, "Scene to write: .ply, .splat, .spz, .sog, .glb or .tree")
      ->required();
  command
      ->add_option("--gaussians", options->gaussians,
                   "Number of Gaussians, 1000 to 64000000; a city as .tree has no such end")
      ->capture_default_str();
  command
      ->add_option("--seed", options->seed, "The same seed gives the same scene on every machine")
      ->capture_default_str();
  add_tree_options(*command, options->tree);
  command->callback([options, command] { synth(*options, is_quiet(*command)); });
}

}  // namespace catgs
