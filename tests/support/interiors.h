#pragma once

#include <cstddef>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs::test {

/// A captured hall, 39 x 12 x 8 m around the origin, y down and its floor at y = 0: columns,
/// benches, pictures on the walls, faint floaters inside and dense ones up to 30 m outside.
GaussianCloud hall(std::size_t gaussians);

/// A captured flat of four rooms, 12 x 9 x 2.6 m, with furniture and doors. Z points up from its
/// floor at z = 0; noise lies on the roof and around it.
GaussianCloud flat(std::size_t gaussians);

}  // namespace catgs::test
