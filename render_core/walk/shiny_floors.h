#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "render_core/walk/occupancy.h"
#include "render_core/walk/surfaces.h"

namespace catgs::walk {

/// Floor that shines is missing in a capture, because its Gaussians lie in the mirrored room below.
/// Adds it to `occupancy`: gaps beside the floor that is reached, at the same height, below a
/// ceiling, and above something that is not reached. Returns how many cells were added. `turn` is
/// called often, and may throw.
std::size_t add_shiny_floors(Occupancy& occupancy, const Surfaces& surfaces, const Person& person,
                             std::span<const std::uint32_t> reached,
                             const std::function<void()>& turn);

}  // namespace catgs::walk
