#include "server/scenes/compute_walkable_area.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/scene_by_parts.h"
#include "render_core/walk/eye_height.h"
#include "render_core/walk/inhabited_area.h"
#include "render_core/walk/walk_file.h"
#include "server/scenes/derived_files.h"
#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_ids.h"

namespace catgs {
namespace {

constexpr std::uint64_t most_whole_gaussians = 4'000'000;  // of a scene that is read as a whole

std::string spec_of(const WalkableAreaSource& source) { return source.scene.given.string(); }

/// Always the same representation, whatever of the scene is in memory.
SceneByParts open(const WalkableAreaSource& source, const std::shared_ptr<ThreadPool>& pool,
                  const std::function<void()>& progress) {
  constexpr std::uint64_t part_rows = 1'000'000;
  LoadOptions options;
  options.threads = pool->threads();
  options.progress = [&](double) { progress(); };
  const SceneLocation& scene = source.scene;
  if (scene.is_in_pages()) return by_parts(open_in_pages(scene, options), pool);
  if (auto parted = scene_in_parts(scene, options, pool, part_rows, false))
    return by_parts(*std::move(parted));
  if (read_scene_size(scene, options).gaussians > most_whole_gaussians) {
    if (!source.tree.empty()) return by_parts(open_in_pages(source.tree, scene, options), pool);
    throw InputError(spec_of(source), "", "has too many Gaussians to be read as a whole",
                     "with --cache-dir it gets a tree");
  }
  options.first_view = false;
  return by_parts(load_scene(scene, options));
}

SceneHints hints_of(const WalkableAreaSource& source, const glm::dvec3& origin) {
  SceneHints hints;
  hints.start_pose.position = glm::vec3(source.start - origin);
  hints.up = source.up;
  hints.about.metres_per_unit = source.metres_per_unit;
  return hints;
}

/// A mistake in the scene itself does not pass, so it means that there is no walkable area.
template <class Body>
auto known_of_scene(const Body& body) {
  try {
    return body();
  } catch (const InputError& error) {
    throw NoWalkableArea(error);
  }
}

std::vector<float> eye_heights_of(const WalkableAreaSource& source, const GaussianCloud& sample,
                                  const glm::dvec3& origin) {
  std::vector<float> heights = walk::eye_heights_of(sample, hints_of(source, origin));
  if (heights.empty())
    throw InputError(spec_of(source), "", "has no rooms that tell how large people are",
                     "its sidecar can name metres_per_unit");
  return heights;
}

}  // namespace

WalkableAreaSource walkable_area_source(const SceneLocation& scene, const SceneFacts& facts) {
  WalkableAreaSource source;
  source.scene = scene;
  source.start = glm::dvec3(facts.start_pose.position) + facts.origin;
  source.up = facts.up;
  source.metres_per_unit = facts.about.metres_per_unit;
  return source;
}

bool same_walkable_area(const WalkableAreaSource& one, const WalkableAreaSource& other) {
  return one.scene.given == other.scene.given && one.start == other.start && one.up == other.up &&
         one.metres_per_unit == other.metres_per_unit;
}

std::string compute_walkable_area(const WalkableAreaSource& source, int threads,
                                  const std::function<void()>& progress) {
  constexpr std::size_t most_blocks = std::size_t{1} << 21;
  const auto pool = std::make_shared<ThreadPool>(threads);
  const std::string spec = spec_of(source);
  std::optional<SceneByParts> scene;
  if (!is_synthetic(spec)) scene = open(source, pool, progress);
  const glm::dvec3 origin = scene ? scene->hints.origin : glm::dvec3(0.0);
  const GaussianCloud nothing;  // a synthetic scene has a unit
  const auto eye_heights = known_of_scene(
      [&] { return eye_heights_of(source, scene ? *scene->sample : nothing, origin); });
  bool is_read = true;
  const auto add_scene = [&](walk::Occupancy& occupancy) {
    const auto take = [&](const GaussianCloud& part) {
      known_of_scene([&] { occupancy.add(part, *pool, progress); });
    };
    is_read = false;
    if (scene)
      scene->each(take);
    else
      synthesize_parts(spec, *pool, take);
    is_read = true;
  };
  try {
    walk::WalkMap map = walk::find_inhabited_area({.name = spec,
                                                   .start = glm::vec3(source.start - origin),
                                                   .up = source.up,
                                                   .eye_heights = eye_heights,
                                                   .add_scene = add_scene,
                                                   .most_blocks = most_blocks,
                                                   .progress = progress},
                                                  *pool);
    map.origin = origin;
    return walk::pack(map);
  } catch (const InputError& error) {
    if (is_read) throw NoWalkableArea(error);
    throw;
  }
}

std::string walkable_area_name(const WalkableAreaSource& source) {
  constexpr int version = 3;  // of what is found in a scene
  const SceneLocation& scene = source.scene;
  const std::string files = is_synthetic(spec_of(source)) ? "" : content_facts(scene);
  const std::string facts = fmt::format("{}\n{} {} {}\n{} {} {}\n{} {}", files, source.start.x,
                                        source.start.y, source.start.z, source.up.x, source.up.y,
                                        source.up.z, source.metres_per_unit, version);
  return derived_name(scene, facts, ".walk");
}

}  // namespace catgs
