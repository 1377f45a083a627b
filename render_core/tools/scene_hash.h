#pragma once

#include <cstdint>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Identifies what was measured, whatever file it came from: equal clouds have equal hashes. Not
/// for security.
std::uint64_t scene_hash(const GaussianCloud& cloud);

}  // namespace catgs
