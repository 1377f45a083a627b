#pragma once

#include <functional>
#include <string_view>

#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/walk/occupancy.h"
#include "render_core/walk/walk_map.h"

namespace catgs::walk {

/// The walkable area of a scene: the ground that a person reaches on foot, and the obstacles around
/// it.
///
/// The top of a run of solid cells is ground where a body has room above it and the slope is not
/// too steep. Ground of neighbouring columns is connected where it is no more than a step apart
/// and a body fits through. It is clear where it is connected all around within the body's
/// radius. Of the clear ground, all that is connected to a place below `start` (world) is kept:
/// with the nearest such place that reaches at least a twentieth as far as the largest, or that has
/// 4 m² right below the start.
///
/// Floor that shines is added to `occupancy` first: see shiny_floors.h.
///
/// Throws InputError for `name` if there is none. `progress` is called often, by several
/// threads at a time, and may throw to end the search.
WalkMap find_walkable_area(
    Occupancy& occupancy, const Person& person, const glm::vec3& start, std::string_view name,
    ThreadPool& pool, const std::function<void()>& progress = [] {});

}  // namespace catgs::walk
