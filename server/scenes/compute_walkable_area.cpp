#include "server/scenes/compute_walkable_area.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/scene_by_parts.h"
#include "render_core/walk/eye_height.h"
#include "render_core/walk/walk_file.h"
#include "render_core/walk/walkable_area.h"
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

float eye_height_of(const WalkableAreaSource& source, const GaussianCloud& sample,
                    const glm::dvec3& origin) {
  if (const auto height = walk::eye_height_of(sample, hints_of(source, origin))) return *height;
  throw InputError(spec_of(source), "", "has no floor and ceiling that tell how large people are",
                   "its sidecar can name metres_per_unit");
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
  std::optional<walk::Occupancy> occupancy;
  glm::dvec3 origin(0.0);
  glm::vec3 start;
  const auto begin = [&](const GaussianCloud& sample) {
    const float eye_height = eye_height_of(source, sample, origin);
    start = glm::vec3(source.start - origin);
    occupancy.emplace(walk::grid_around(start, source.up, eye_height), most_blocks);
  };
  const auto take = [&](const GaussianCloud& part) {
    known_of_scene([&] { occupancy->add(part, *pool, progress); });
  };
  const std::string spec = spec_of(source);
  if (is_synthetic(spec)) {
    begin({});  // it has a unit
    synthesize_parts(spec, *pool, take);
  } else {
    const SceneByParts scene = open(source, pool, progress);
    origin = scene.hints.origin;
    known_of_scene([&] { begin(*scene.sample); });
    scene.each(take);
  }
  walk::WalkMap map = known_of_scene(
      [&] { return walk::find_walkable_area(*occupancy, {}, start, spec, *pool, progress); });
  map.origin = origin;
  return walk::pack(map);
}

std::string walkable_area_name(const WalkableAreaSource& source) {
  constexpr int version = 2;  // of what is found in a scene
  const SceneLocation& scene = source.scene;
  const std::string files = is_synthetic(spec_of(source)) ? "" : content_facts(scene);
  const std::string facts = fmt::format("{}\n{} {} {}\n{} {} {}\n{} {}", files, source.start.x,
                                        source.start.y, source.start.z, source.up.x, source.up.y,
                                        source.up.z, source.metres_per_unit, version);
  return derived_name(scene, facts, ".walk");
}

}  // namespace catgs
