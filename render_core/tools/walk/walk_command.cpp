// catgs-render walk: describes a .walk file, and walks by it through the scene that it was made of.
#include <filesystem>
#include <memory>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/scene_options.h"
#include "render_core/tools/walk/plan_files.h"
#include "render_core/tools/walk/scripted_walk.h"
#include "render_core/walk/walk_file.h"

namespace catgs {
namespace {

struct WalkOptions {
  std::string file;
  SceneOptions scene;
  double minutes = 10.0;
  std::uint64_t seed = 1;
  std::string plan;
  std::vector<float> at;
  int threads = 0;
};

void walk_through(const walk::WalkMap& map, const WalkOptions& options, bool quiet) {
  ThreadPool pool(options.threads);
  const ScriptedWalk walk = scripted_walk(map, 60.0 * options.minutes, options.seed);
  const Scene scene = load_scene(options.scene, options.threads, quiet);
  const WalkCheck check = check_walk(map, walk, SightLines(scene.cloud, pool), pool);
  const float per_eye_height = 1.0f / walk::cells_per_eye_height;
  fmt::print("{} min, {:.0f} eye heights long, {:.1f} up in all; {} of {} goals reached\n",
             options.minutes, check.length * per_eye_height, check.climbed * per_eye_height,
             walk.reached, walk.goals);
  fmt::print("{} of {} pieces pass a wall; the darkest lets {:.0f} % of the light through\n",
             check.blocked, check.pieces, 100.0f * check.least_light);
  fmt::print(
      "{} pieces have no ground; the thinnest lets {:.0f} % of the light through; largest "
      "drop at once {:.3f} eye heights\n",
      check.unsupported, 100.0f * check.most_light_below, check.largest_drop * per_eye_height);
  for (const glm::vec3& at : check.faults)
    fmt::print("  at {:.4g} {:.4g} {:.4g}\n", at.x, at.y, at.z);
  if (!check.passed(map.person)) throw CheckFailed("the walk passed a wall, or fell");
  if (walk.reached < walk.goals) throw CheckFailed("a goal was not reached");
}

void print_ground(const walk::WalkMap& map, const glm::vec3& place) {
  const auto stand = walk::stand_below(map, place);
  const glm::vec3 eyes = stand ? walk::eyes_of(map, *stand) : place;
  fmt::print("below {:.4g} {:.4g} {:.4g}: {}\n", place.x, place.y, place.z,
             stand ? fmt::format("eyes at {:.4g} {:.4g} {:.4g}", eyes.x, eyes.y, eyes.z)
                   : "nobody can stand there");
}

void walk_command(const WalkOptions& options, bool quiet) {
  const FileSource file(options.file);
  const walk::WalkMap map = walk::read_walk_file(file);
  print_map(map, file.size());
  if (!options.plan.empty()) write_plans(map, options.plan);
  if (options.at.size() == 3) print_ground(map, {options.at[0], options.at[1], options.at[2]});
  if (!options.scene.path.empty()) walk_through(map, options, quiet);
}

}  // namespace

void add_walk_command(CLI::App& app) {
  auto options = std::make_shared<WalkOptions>();
  CLI::App* command = app.add_subcommand(
      "walk", "Describes a .walk file; with its scene, walks through it and checks each step");
  command->add_option("file", options->file, "A file of `floors`")->required();
  add_scene_options(*command, options->scene);
  command->get_option("scene")->required(false);
  command->add_option("--minutes", options->minutes, "Length of the walk")
      ->check(CLI::Range(0.1, 600.0))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Of the walk's goals")->capture_default_str();
  command
      ->add_option("--at", options->at,
                   "A place of the world: print where a person below it has the eyes")
      ->expected(3);
  command->add_option("--plan", options->plan, "Write the floor plans as PNG");
  command->add_option("--threads", options->threads, "0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->callback([options, command] { walk_command(*options, is_quiet(*command)); });
}

}  // namespace catgs
