#pragma once

#include <functional>
#include <string_view>

#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/walk/occupancy.h"
#include "render_core/walk/walk_map.h"

namespace catgs::walk {

/// The ground that a person reaches on foot, and the obstacles around it.
///
/// The top of a run of solid cells is ground where a body has room above it and the slope is not
/// too steep. Ground of neighbouring columns hangs together where it is no more than a step apart
/// and a body fits through. It is clear where it hangs together all around within the body's
/// radius. Of the clear ground, all that hangs together with a place below `start` (world) is kept:
/// with the nearest such place that reaches at least a twentieth as far as the largest.
///
/// Throws InputError for `name` where there is no ground. `progress` is called often, by several
/// threads at a time, and may throw to end the search.
WalkMap find_ground(
    const Occupancy& occupancy, const Person& person, const glm::vec3& start, std::string_view name,
    ThreadPool& pool, const std::function<void()>& progress = [] {});

}  // namespace catgs::walk
