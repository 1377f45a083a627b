#pragma once

namespace catgs {

// Data of formulas in math/*-inl.h that interfaces without SIMD hand on.

/// Projective map from one image plane to another, by the rows of its 3x3 matrix: what the pictures
/// of a camera that only turns do to each other. Both planes in px.
template <class T>
struct Homography {
  T xx = T(1), xy = T(0), x = T(0);
  T yx = T(0), yy = T(1), y = T(0);
  T wx = T(0), wy = T(0), w = T(1);
};

/// What a key frame adds to the outlines of its Gaussians, so that its lists hold for every camera
/// of its guard set and not only for those of the forecast.
template <class T>
struct ListGrowth {
  T parallax = T(0);   // focal length times tau, px world units: how far the camera may be off
  T curvature = T(0);  // 1 / px: what a turn bends, which is linear in the projection of a Gaussian
  T constant = T(0);   // px
  T wide = T(0);  // share of their radius, for Gaussians that are linearised elsewhere after a turn
  T slope_min_x = T(0), slope_min_y = T(0);  // x/z and y/z of all others
  T slope_max_x = T(0), slope_max_y = T(0);
  T turn_sine = T(0), turn_cosine = T(1);  // of how far the camera may turn
  T steepest = T(0), oblique = T(1);       // slopes of the picture; sqrt(1 + slope^2) where clamped
};

}  // namespace catgs
