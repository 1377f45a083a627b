// catgs-render floors: where people can walk in a scene.
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <sys/resource.h>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/image/png.h"
#include "render_core/scene/files/scene_by_parts.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/progress.h"
#include "render_core/tools/scene_options.h"
#include "render_core/walk/eye_height.h"
#include "render_core/walk/inhabited_area.h"
#include "render_core/walk/plan.h"
#include "render_core/walk/walk_file.h"

namespace catgs {
namespace {

struct FloorsOptions {
  SceneOptions scene;
  std::string out;
  std::optional<float> eye_height;
  std::string plan;
  int threads = 0;
};

SceneByParts open_parts(const FloorsOptions& options, const std::shared_ptr<ThreadPool>& pool,
                        bool quiet) {
  const SceneLocation location = locate_scene(options.scene.path);
  if (location.is_in_pages())
    return by_parts(open_in_pages(location, options.scene, options.threads, quiet), pool);
  LoadOptions load;
  load.up = up_of(options.scene);
  load.model = model_of(options.scene);
  if (!options.scene.lod && !options.scene.budget)
    if (auto scene = scene_in_parts(location, load, pool)) return by_parts(*std::move(scene));
  return by_parts(load_scene(location, options.scene, options.threads, quiet));
}

std::vector<float> eye_heights_of(const FloorsOptions& options, const SceneByParts& parts) {
  if (options.eye_height) {
    if (!(*options.eye_height > 0.0f && *options.eye_height <= 1e6f))
      throw InputError("--eye-height", "", fmt::format("{} is not a height", *options.eye_height),
                       "in the scene's units, over 0");
    return {*options.eye_height};
  }
  std::vector<float> heights = walk::eye_heights_of(*parts.sample, parts.hints);
  if (heights.empty())
    throw InputError(options.scene.path, "", "has no rooms that would tell how large a person is",
                     "give --eye-height in the scene's units: 1.6 where these are metres, or "
                     "metres_per_unit in its sidecar");
  return heights;
}

void print_map(const walk::WalkMap& map, std::uint64_t file_bytes) {
  const glm::vec2 size = glm::vec2(map.size) * map.grid.cell;
  fmt::print("{:.1f} x {:.1f} units, {} x {} columns, {} points, {:.1f} kB; north is {}\n", size.x,
             size.y, map.size.x, map.size.y, map.positions.size(),
             1e-3 * static_cast<double>(file_bytes), walk::north_of(map.grid));
  for (std::size_t k = 0; k < map.storeys.size(); ++k) {
    const walk::Storey& storey = map.storeys[k];
    fmt::print("storey {}: {:.2f} eye heights above the start's ground, {:.1f} square units\n", k,
               (storey.level - map.start.height) / walk::cells_per_eye_height,
               static_cast<float>(storey.area) * map.grid.cell * map.grid.cell);
  }
}

/// Writes the plan of each storey: `out`, or for several storeys plan-0.png, plan-1.png… from
/// below, for a name of plan.png.
void write_plans(const walk::WalkMap& map, const std::filesystem::path& out) {
  for (std::size_t k = 0; k < map.storeys.size(); ++k) {
    std::filesystem::path path = out;
    if (map.storeys.size() > 1)
      path.replace_filename(
          fmt::format("{}-{}{}", out.stem().string(), k, out.extension().string()));
    write_png(path, walk::draw_plan(map, k));
    fmt::print("{}: plan of storey {}, {} is up\n", path.string(), k, walk::north_of(map.grid));
  }
}

void floors(const FloorsOptions& options, bool quiet) {
  using Clock = std::chrono::steady_clock;
  const auto seconds_since = [](Clock::time_point t) {
    return std::chrono::duration<double>(Clock::now() - t).count();
  };
  if (std::filesystem::path(options.out).extension() != ".walk")
    throw InputError(options.out, "", "is not the name of a .walk file",
                     "the server reads the walkable area of hall.ply from hall.walk");
  check_writable(options.out);
  const auto pool = std::make_shared<ThreadPool>(options.threads);
  const auto begin = Clock::now();
  const SceneByParts parts = open_parts(options, pool, quiet);
  const std::vector<float> eye_heights = eye_heights_of(options, parts);
  const double opened_s = seconds_since(begin);
  double reading_s = 0.0;
  std::uint64_t gaussians = 0;
  std::size_t cell_bytes = 0;
  const auto add_scene = [&](walk::Occupancy& occupancy) {
    const auto reads = Clock::now();
    gaussians = 0;
    parts.each([&](const GaussianCloud& part) {
      occupancy.add(part, *pool);
      gaussians += part.size();
    });
    cell_bytes = occupancy.bytes();
    reading_s += seconds_since(reads);
  };
  walk::WalkMap map = walk::find_inhabited_area({.name = options.scene.path,
                                                 .start = parts.hints.start_pose.position,
                                                 .up = parts.hints.up,
                                                 .eye_heights = eye_heights,
                                                 .add_scene = add_scene},
                                                *pool);
  map.origin = parts.hints.origin;
  const double search_s = seconds_since(begin) - opened_s - reading_s;
  walk::write_walk_file(map, options.out);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  fmt::print("{}: {} Gaussians, eye height {:.4g}{}, cells of {:.4g}\n", options.out, gaussians,
             map.grid.cell * walk::cells_per_eye_height,
             options.eye_height                         ? ""
             : parts.hints.about.metres_per_unit > 0.0f ? " (1.6 m)"
                                                        : " (estimated)",
             map.grid.cell);
  print_map(map, std::filesystem::file_size(options.out));
  fmt::print(
      "opened in {:.1f} s, occupancy {:.1f} s with reading, ground {:.1f} s; "
      "cells {:.0f} MB, peak memory {:.0f} MB\n",
      opened_s, reading_s, search_s, 1e-6 * static_cast<double>(cell_bytes),
      1e-3 * static_cast<double>(usage.ru_maxrss) * 1.024);
  if (!options.plan.empty()) write_plans(map, options.plan);
}

}  // namespace

void add_floors_command(CLI::App& app) {
  auto options = std::make_shared<FloorsOptions>();
  CLI::App* command = app.add_subcommand("floors", "Finds where people can walk in a scene");
  add_scene_options(*command, options->scene);
  command->add_option("out", options->out, "File to write, .walk")->required();
  command->add_option("--eye-height", options->eye_height,
                      "Of a person, in the scene's units [1.6 m if its sidecar has "
                      "metres_per_unit, else from the room's height at the start]");
  command->add_option("--plan", options->plan,
                      "Also write the floor plan as PNG; of several storeys, one each");
  command->add_option("--threads", options->threads, "0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->callback([options, command] { floors(*options, is_quiet(*command)); });
}

}  // namespace catgs
