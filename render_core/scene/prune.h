#pragma once

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Keeps the ceil(fraction * N) Gaussians that stop the most light, in their order. `fraction` in
/// (0, 1].
///
/// The importance of a Gaussian is o (s_x s_y + s_y s_z + s_z s_x). Up to a common factor, that is
/// its opacity times the area that it covers on average over all view directions (Cauchy: a convex
/// body's mean shadow is a quarter of its surface). The volume, often used, would remove flat
/// Gaussians, which surfaces consist of. The measure knows no cameras, so it also keeps Gaussians
/// that are never seen.
void keep_most_important(GaussianCloud& cloud, double fraction);

}  // namespace catgs
