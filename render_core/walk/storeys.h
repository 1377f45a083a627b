#pragma once

#include <vector>

#include "render_core/walk/walk_map.h"

namespace catgs::walk {

/// The storeys of a map: heights that much of its clear ground has. Two of them are storeys of
/// their own where they are a body's height apart and little ground lies in between, as on stairs.
std::vector<Storey> find_storeys(const WalkMap& map);

}  // namespace catgs::walk
