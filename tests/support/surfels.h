#pragma once

#include <vector>

#include "render_core/frame/renderer.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs::test {

/// Draws the discs of 2DGS as its authors do (Huang et al. 2024): each pixel's ray meets the plane
/// of a disc, and the Gaussian of the place in the disc is its weight, at least that of a low-pass
/// of 1/2 px² around the centre. In double precision, without tiles; colours of degree 0; in the
/// order of the centres' depths. Rows of RGB.
std::vector<float> render_surfels(const GaussianCloud& cloud, const FrameRequest& request);

/// A floor of 8 x 8 units around (0, 0, 0), y down, of overlapping discs in a pattern of colours,
/// with a wall of 8 x 2 units at its far end, z = 4.
GaussianCloud surfel_room();

}  // namespace catgs::test
