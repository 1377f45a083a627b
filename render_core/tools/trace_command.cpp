// catgs-render trace: makes pose streams.
#include <memory>

#include "render_core/motion/script.h"
#include "render_core/scene/scene.h"
#include "render_core/tools/commands.h"

namespace catgs {
namespace {

struct TraceScriptOptions {
  std::string scene;
  ScriptOptions script;
  std::string out;
};

}  // namespace

void add_trace_command(CLI::App& app) {
  CLI::App* trace = app.add_subcommand("trace", "Makes camera traces (TUM files)");
  trace->require_subcommand(1);

  auto options = std::make_shared<TraceScriptOptions>();
  CLI::App* script = trace->add_subcommand("script", "Writes a scripted trace for a scene");
  script->add_option("scene", options->scene, "Scene whose start pose and limits are used")
      ->required();
  script
      ->add_option("--script", options->script.script,
                   "orbit, walk, head, drone, still or tour:FILE (a TUM file of keyframes)")
      ->required();
  script->add_option("--seed", options->script.seed, "Same seed, same trace")
      ->capture_default_str();
  script->add_option("--duration", options->script.duration_s, "Seconds")->capture_default_str();
  script->add_option("--fps", options->script.rate_hz, "Poses per second")->capture_default_str();
  script->add_option("--out", options->out, "TUM file to write")->required();
  script->callback([options] {
    write_tum(options->out, make_script(options->script, load_scene(options->scene).hints));
  });
}

}  // namespace catgs
