#pragma once

#include <optional>
#include <vector>

#include "server/encode/packed_depths.h"

namespace catgs::load {

/// The inverse depths; nothing where they are not a packed grid of at most max_depth_cells a side.
std::optional<std::vector<float>> unpack(const PackedDepths& packed);

}  // namespace catgs::load
