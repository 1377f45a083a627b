#pragma once

#include <optional>

#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// Per world axis, the opacity-weighted quantiles `tail` and 1 - `tail` of the means: the bounds of
/// the content, without its stray Gaussians. Gaussians with values that are not finite or with an
/// opacity outside (0, 1] are ignored. Large scenes are judged by an even sample of at most 2^16,
/// which moves the share outside by about 0.1 %. Empty when no Gaussian is left.
std::optional<Bounds> robust_bounds(const GaussianCloud& cloud, float tail = 0.05f);

}  // namespace catgs
