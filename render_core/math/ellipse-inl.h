#if defined(CATGS_MATH_ELLIPSE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_ELLIPSE_INL_H
#undef CATGS_MATH_ELLIPSE_INL_H
#else
#define CATGS_MATH_ELLIPSE_INL_H
#endif

#include "render_core/math/constants.h"
#include "render_core/math/number-inl.h"
#include "render_core/math/projection-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

/// Upper triangular factor of the conic, scaled so that a Gaussian's exponent to base 2 at d =
/// pixel - centre is log2(opacity) - (xx dx + xy dy)^2 - (yy dy)^2.
///
/// The same two multiply-adds per pixel as the conic itself, but without its cancellation: for a
/// needle the conic's terms are a million times their sum.
template <class T>
struct Whitening {
  T xx, xy, yy;
};

template <class T>
CATGS_HD_INLINE Whitening<T> whitening(const ProjectedGaussian<T>& g) {
  const T scale = T(exponent_scale);
  const T root_yy = sqrt(g.yy);
  const T k = scale / (root_yy * sqrt(g.determinant));
  return {g.yy * k, -g.xy * k, scale / root_yy};
}

/// Squared distance from the centre in the whitened plane, in units of the base-2 exponent.
template <class T>
CATGS_HD_INLINE T whitened_square(const Whitening<T>& w, const Vec2<T>& d) {
  const T u = mul_add(w.xx, d.x, w.xy * d.y);
  const T v = w.yy * d.y;
  return mul_add(u, u, v * v);
}

/// A Gaussian's base-2 exponent over the image plane: log2_opacity - (u + xx x + xy y)^2 - (v + yy
/// y)^2. The origin is near the pixels, so that the linear parts are small numbers.
template <class T>
struct ExponentField {
  T u, xx, xy;
  T v, yy;
  T log2_opacity;
};

/// `centre_px` is relative to the origin.
template <class T>
CATGS_HD_INLINE ExponentField<T> exponent_field(const Whitening<T>& w, const Vec2<T>& centre_px,
                                                T log2_opacity) {
  return {-mul_add(w.xx, centre_px.x, w.xy * centre_px.y),
          w.xx,
          w.xy,
          -(w.yy * centre_px.y),
          w.yy,
          log2_opacity};
}

/// A Gaussian reaches alpha_min where whitened_square <= reach; negative: nowhere.
template <class T>
CATGS_HD_INLINE T reach_of(T log2_opacity) {
  return log2_opacity - T(log2_alpha_min);
}

/// Half the width and height in px of the box around {whitened_square <= reach}, reach >= 0.
template <class T>
CATGS_HD_INLINE Vec2<T> half_extent(const ProjectedGaussian<T>& g, T reach) {
  const T squared_sigmas = reach * T(1.0 / (exponent_scale * exponent_scale));
  return {sqrt(squared_sigmas * g.xx), sqrt(squared_sigmas * g.yy)};
}

/// The same from the whitening.
template <class T>
CATGS_HD_INLINE Vec2<T> half_extent(const Whitening<T>& w, T reach) {
  const T half_height = sqrt(reach) / w.yy;
  return {half_height * sqrt(mul_add(w.xy, w.xy, w.yy * w.yy)) / w.xx, half_height};
}

/// The original's bound: three standard deviations along the longest axis, whole pixels.
template <class T>
CATGS_HD_INLINE T three_sigma_radius(const ProjectedGaussian<T>& g) {
  const T middle = T(0.5) * (g.xx + g.yy);
  const T largest = middle + sqrt(max(T(0.1), middle * middle - g.determinant));
  return ceil(T(3.0) * sqrt(largest));
}

/// dy of the rightmost point of {whitened_square <= reach}; the leftmost is at the opposite.
template <class T>
CATGS_HD_INLINE T rightmost_y(const Whitening<T>& w, T reach) {
  const T steepness = mul_add(w.xy, w.xy, w.yy * w.yy);
  return -w.xy * sqrt(reach / steepness) / w.yy;
}

/// The ellipse {whitened_square <= reach} prepared for being cut into bands of rows.
template <class T>
struct Ellipse {
  Whitening<T> w;
  T reach;
  T inverse_xx;
  T rightmost_y;
};

/// `reach` (at most 8) is widened by the rounding error that it can have in `w`, so that a listed
/// set misses no pixel.
template <class T>
CATGS_HD_INLINE Ellipse<T> make_ellipse(const Whitening<T>& w, T reach, T half_extent_x,
                                        T rightmost) {
  return {w, reach + T(1e-4) + T(3e-6) * w.xx * half_extent_x, T(1.0) / w.xx, rightmost};
}

/// The ellipse with its axes exchanged, for cuts into bands of columns: columns_in_band() of the
/// result gives rows. `reach` as in make_ellipse().
template <class T>
CATGS_HD_INLINE Ellipse<T> make_transposed_ellipse(const Whitening<T>& w, T reach) {
  const T root = sqrt(reach);
  const T xx = sqrt(mul_add(w.xy, w.xy, w.yy * w.yy));
  const T scale = w.xx / xx;
  const T half_height = root / w.yy;
  return make_ellipse<T>({xx, w.xy * scale, w.yy * scale}, reach, half_height,
                         -w.xy * half_height / w.xx);
}

template <class T, class S>
CATGS_HD_INLINE Ellipse<T> convert(const Ellipse<S>& e) {
  return {{T(e.w.xx), T(e.w.xy), T(e.w.yy)}, T(e.reach), T(e.inverse_xx), T(e.rightmost_y)};
}

template <class T>
struct Interval {
  T low, high;  // empty when low > high
};

/// Columns dx that the ellipse covers within the rows low.y <= dy <= high.y (relative to its
/// centre). Exact: the cut is convex, so a rectangle on these rows meets the ellipse if and only if
/// its columns meet this interval.
template <class T>
CATGS_HD_INLINE Interval<T> columns_in_band(const Ellipse<T>& e, T low_y, T high_y) {
  const T right_y = clamp(e.rightmost_y, low_y, high_y);
  const T left_y = clamp(-e.rightmost_y, low_y, high_y);
  const T right_rest = e.reach - e.w.yy * right_y * e.w.yy * right_y;
  const T left_rest = e.reach - e.w.yy * left_y * e.w.yy * left_y;
  const T zero = T(0.0);
  const T right = (sqrt(max(right_rest, zero)) - e.w.xy * right_y) * e.inverse_xx;
  const T left = (-sqrt(max(left_rest, zero)) - e.w.xy * left_y) * e.inverse_xx;
  const auto hit = (right_rest >= zero) & (left_rest >= zero);
  return {select(hit, left, T(1.0)), select(hit, right, T(-1.0))};
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
