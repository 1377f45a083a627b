#pragma once

#include <cstddef>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Joins pairs of Gaussians until `wanted` (at least 1) are left. Fewer ones stay as they are.
///
/// A pair becomes one Gaussian by the moment matching of tree/merge_nodes.h. It does not grow: over
/// many rounds that would blur. So the sums over the
/// scene of w, w mean and w SH are kept, where w = o A is opacity x RMS projected area, unless an
/// opacity has to be clamped. A Gaussian that is never joined stays bit for bit.
///
/// Pairs are chosen by the error of their picture. For the views along the three axes, it is
///
///   E = integral of |f_a + f_b - f_m|^2,  f_i(u) = o_i c_i exp(-u^T S_i^-1 u / 2)
///
/// with the merged Gaussian m, the projected covariance S_i and the colour c_i = (R, G, B, ground).
/// The fourth channel stands for what is behind, which the Gaussians hide. The integrals have a
/// closed form. So faint, small and redundant Gaussians go first, wherever they are. E knows
/// neither cameras nor occlusion.
///
/// Each round sorts the Gaussians along a Morton curve. Each one looks at the next 32, and takes
/// the cheapest four by the cost of merge_nodes.h. Of these it takes the one with the least E. Then
/// pairs join in the order of E, each Gaussian at most once, up to 45 % of all in a round.
///
/// Takes about 130 bytes per Gaussian beside the cloud. The result depends on the cloud and
/// `wanted`, not on threads.
void merge_gaussians(GaussianCloud& cloud, std::size_t wanted, ThreadPool& pool,
                     const LoadContext& context);

}  // namespace catgs
