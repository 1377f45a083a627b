#pragma once

#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// The rule by which every Gaussian that enters the system is judged; afterwards GaussianCloud's
/// invariants hold. In this order:
///
/// Dropped:
///  1. mean, scale, rotation or opacity is NaN or infinite;
///  2. peak alpha under 1/255: every pipeline skips such contributions (math/constants.h:
///     alpha_min), so no pixel changes, and the memory and the culling time are saved; less than
///     1e-5 of it under counts as rounding;
///  3. absurd: a coordinate or scale over 1e9 (its fourth power, a 2D covariance's determinant,
///     would overflow), or farther from the middle of the robust bounds, or larger, than 1e4 times
///     their diagonal. What lies that far out is a float that escaped in training, and one such
///     Gaussian stretches every bounding box.
/// Repaired:
///  4. a zero quaternion becomes the identity, which is what the original renderer makes of it;
///  5. scales under 1e-10 (their squares would be denormal; on screen the low-pass filter hides
///     the difference) and opacities of 1 are clamped into the valid range;
///  6. SH coefficients that are NaN or beyond 1000 become 0.
/// Quaternions are normalised; that is not counted as a repair.
///
/// The order of the kept Gaussians stays, and so do the vectors' allocations.
SanitizeReport sanitize(GaussianCloud& cloud, const LoadContext& context);

}  // namespace catgs
