#pragma once

#include <cstdint>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Identifies a measured scene by its content, not its file: equal clouds have equal hashes. Not
/// for security.
std::uint64_t scene_hash(const GaussianCloud& cloud);

}  // namespace catgs
