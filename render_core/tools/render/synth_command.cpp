// catgs-render synth: writes a procedural scene and, beside it, how to look at it.
#include <memory>

#include <fmt/format.h>

#include "render_core/scene/files/hints.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/synth/synth.h"
#include "render_core/tools/commands.h"

namespace catgs {
namespace {

struct SynthOptions {
  std::string kind;
  std::size_t gaussians = 300'000;
  std::uint64_t seed = 1;
  std::string out;
};

}  // namespace

void add_synth_command(CLI::App& app) {
  auto options = std::make_shared<SynthOptions>();
  CLI::App* synth = app.add_subcommand("synth", "Writes a procedural scene");
  synth->add_option("kind", options->kind, "city, garden or stress")->required();
  synth->add_option("out", options->out, "Scene to write: .ply, .splat or .spz")->required();
  synth->add_option("--gaussians", options->gaussians, "1000 to 64000000")->capture_default_str();
  synth->add_option("--seed", options->seed, "Same seed, same scene, on every machine")
      ->capture_default_str();
  synth->callback([options] {
    const SynthKind kind = parse_synth_kind(options->kind);
    const Scene scene = synthesize(kind, options->gaussians, options->seed);
    // The sidecar first: where the scene is, its start pose is too.
    write_sidecar(scene.hints, sidecar_of(options->out));
    save_scene(scene.cloud, options->out);
  });
}

}  // namespace catgs
