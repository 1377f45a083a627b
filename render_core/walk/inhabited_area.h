#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string_view>

#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/walk/occupancy.h"
#include "render_core/walk/walk_map.h"

namespace catgs::walk {

/// A scene whose walkable area is looked for. Places are about its origin.
struct AreaOfScene {
  std::string_view name;  // for errors
  glm::vec3 start{0.0f};
  glm::vec3 up{0.0f};                         // unit
  std::span<const float> eye_heights;         // world units; the likeliest first, at least one
  std::function<void(Occupancy&)> add_scene;  // adds all Gaussians
  std::size_t most_blocks = std::size_t{1} << 24;
  std::function<void()> progress = [] {};  // as of find_walkable_area()
};

/// The walkable area for the first eye height whose area is inhabited: somebody whose eyes are at
/// the start stands on it, give or take a step. Else for the first one that has an area. Throws
/// InputError as find_walkable_area() does.
WalkMap find_inhabited_area(const AreaOfScene& scene, ThreadPool& pool);

}  // namespace catgs::walk
