#include "render_core/walk/inhabited_area.h"

#include <exception>
#include <optional>
#include <utility>

#include <glm/geometric.hpp>

#include "render_core/base/error.h"
#include "render_core/walk/walkable_area.h"

namespace catgs::walk {
namespace {

/// Visits begin a little higher or lower than eyes are: in the middle of rooms.
bool is_inhabited(const WalkMap& map, const glm::vec3& start) {
  constexpr float lowest = 0.5f, highest = 1.4f;  // eye heights above the ground
  const glm::vec3 at = map.grid.from_world(start);
  const float height = (at.z - map.start.height) / cells_per_eye_height;
  return glm::distance(glm::vec2(at), map.start.position) <= Person::in_cells(map.person.step) &&
         height >= lowest && height <= highest;
}

}  // namespace

WalkMap find_inhabited_area(const AreaOfScene& scene, ThreadPool& pool) {
  std::optional<WalkMap> first;
  std::exception_ptr none;
  for (const float eye_height : scene.eye_heights) {
    Occupancy occupancy(grid_around(scene.start, scene.up, eye_height), scene.most_blocks);
    try {
      scene.add_scene(occupancy);
      WalkMap map =
          find_walkable_area(occupancy, {}, scene.start, scene.name, pool, scene.progress);
      if (is_inhabited(map, scene.start)) return map;
      if (!first) first = std::move(map);
    } catch (const InputError&) {
      if (!none) none = std::current_exception();
    }
  }
  if (!first) std::rethrow_exception(none);
  return *std::move(first);
}

}  // namespace catgs::walk
