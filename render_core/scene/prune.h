#pragma once

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Keeps the ceil(fraction * N) Gaussians that stop the most light, in their order. `fraction` in
/// (0, 1].
///
/// The importance of a Gaussian is o (s_x s_y + s_y s_z + s_z s_x): its opacity times the area that
/// it covers on average over all view directions, up to a common factor (Cauchy: a convex body's
/// mean shadow is a quarter of its surface). The volume, often used, would throw out flat
/// Gaussians, of which surfaces are made. It knows no cameras, so it also keeps what is never seen.
void keep_most_important(GaussianCloud& cloud, double fraction);

}  // namespace catgs
