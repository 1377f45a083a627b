#pragma once

#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// Judges every Gaussian that enters the system; afterwards GaussianCloud's invariants hold. The
/// rules, in this order:
///
/// Dropped:
///   1. mean, scale, rotation or opacity is NaN or infinite;
///   2. peak alpha under 1/255. Every pipeline skips such contributions (math/constants.h:
///      alpha_min), so no pixel changes, and memory and culling time are saved. Up to 1e-5 of it
///      less counts as rounding;
///   3. absurd: a coordinate or scale is over 1e9 (the fourth power, in the determinant of a 2D
///      covariance, would overflow), or its size or its distance from the middle of the robust
///      bounds exceeds 1e4 times their diagonal. Such values are floats that escaped in training,
///      and a single one stretches every bounding box.
/// Repaired:
///   4. a zero quaternion becomes the identity, as in the original renderer;
///   5. scales under 1e-10 (their squares would be denormal; on screen the low-pass filter hides
///      the difference) and opacities of 1 are clamped into the valid range;
///   6. SH coefficients that are NaN or beyond 1000 become 0.
/// Quaternions are normalised; that is not counted as a repair.
///
/// The kept Gaussians stay in order, and the vectors keep their allocations.
SanitizeReport sanitize(GaussianCloud& cloud, const LoadContext& context);

/// A sphere that holds all places that are not absurd by rule 3. A `radius` of 0 sets no limit.
struct SaneReach {
  glm::vec3 centre{0.0f};
  float radius = 0.0f;
};
/// Finds the sphere of a scene, or of an even sample of it.
SaneReach sane_reach(const GaussianCloud& cloud);

/// Judges a part of a scene by the reach of the whole.
SanitizeReport sanitize(GaussianCloud& part, const SaneReach& reach, const LoadContext& context);

}  // namespace catgs
