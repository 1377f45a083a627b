#pragma once

namespace catgs {

// Parameters of formulas in math/*-inl.h, for interfaces that do not include SIMD.

/// Projective map from one image plane to another, by the rows of its 3x3 matrix: how the pictures
/// of a camera that only turns relate to each other. Both planes in px.
template <class T>
struct Homography {
  T xx = T(1), xy = T(0), x = T(0);
  T yx = T(0), yy = T(1), y = T(0);
  T wx = T(0), wy = T(0), w = T(1);
};

/// Added to the outlines of a key frame's Gaussians, so that its lists hold for every camera of its
/// guard set and not only for the forecast.
template <class T>
struct ListGrowth {
  T parallax = T(0);   // px world units: focal length times tau, the camera's largest offset
  T curvature = T(0);  // 1 / px, times the squared radius: second order of a turn
  T constant = T(0);   // px
  T wide = T(0);  // share of the radius, for Gaussians that are linearised elsewhere after a turn
  T slope_min_x = T(0), slope_min_y = T(0);  // no x/z and y/z inside of these bounds is wide
  T slope_max_x = T(0), slope_max_y = T(0);
  T turn_sine = T(0), turn_cosine = T(1);  // of the largest turn of the camera
  T steepest = T(0), oblique = T(1);       // slopes of the picture; sqrt(1 + slope^2) where clamped
};

}  // namespace catgs
