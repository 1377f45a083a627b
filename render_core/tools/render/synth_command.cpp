// catgs-render synth: writes a procedural scene and a sidecar with its hints.
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
  synth->add_option("kind", options->kind, "Kind of scene: city, garden or stress")->required();
  synth->add_option("out", options->out, "Scene to write: .ply, .splat or .spz")->required();
  synth->add_option("--gaussians", options->gaussians, "Number of Gaussians, 1000 to 64000000")
      ->capture_default_str();
  synth->add_option("--seed", options->seed, "The same seed gives the same scene on every machine")
      ->capture_default_str();
  synth->callback([options] {
    const SynthKind kind = parse_synth_kind(options->kind);
    const Scene scene = synthesize(kind, options->gaussians, options->seed);
    // The sidecar is written first, so that the scene never lacks its start pose.
    write_sidecar(scene.hints, sidecar_of(options->out));
    save_scene(scene.cloud, options->out);
  });
}

}  // namespace catgs
