#if defined(CATGS_MATH_TRAIL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_TRAIL_INL_H
#undef CATGS_MATH_TRAIL_INL_H
#else
#define CATGS_MATH_TRAIL_INL_H
#endif

#include "render_core/math/ellipse-inl.h"
#include "render_core/math/number-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

/// The point where a path leaves the view. It runs straight from `inside` (in front of the near
/// plane) to `to`, both in camera space, and ends at `to` or where it reaches the near plane first.
template <class T>
CATGS_HD_INLINE Vec3<T> cut_at_near(const Vec3<T>& inside, const Vec3<T>& to, T near_z) {
  const auto leaves = to.z < near_z;
  const T share = (near_z - inside.z) / select(leaves, to.z - inside.z, T(1.0));
  return {select(leaves, mul_add(share, to.x - inside.x, inside.x), to.x),
          select(leaves, mul_add(share, to.y - inside.y, inside.y), to.y), max(to.z, near_z)};
}

/// Whitening of the smallest ellipse that holds those of `a` and `b`, all around one centre: the
/// outline of a Gaussian that is seen from two places. In the plane whitened by `a`, the covariance
/// of `a` is I and that of `b` some S; the smallest one above both is I + (S - I)+, the positive
/// part by eigenvalues. All sums have positive terms, because for two crossed needles S has a
/// condition of 1e8.
template <class T>
CATGS_HD_INLINE Whitening<T> whitening_of_both(const Whitening<T>& a, const Whitening<T>& b) {
  const T zero = T(0.0), half = T(0.5), one = T(1.0), tiny = T(1e-30);
  // S = N N^T with N = a b^-1, upper triangular as they are.
  const T n_xx = a.xx / b.xx;
  const T n_yy = a.yy / b.yy;
  const T n_xy = (a.xy - n_xx * b.xy) / b.yy;
  const T s_xx = mul_add(n_xx, n_xx, n_xy * n_xy);
  const T s_xy = n_xy * n_yy;
  const T s_yy = n_yy * n_yy;
  // Eigenvalues, and the first one's projector: the larger entry on the diagonal, and the others.
  const T skew = half * (s_xx - s_yy);
  const T radius = max(sqrt(mul_add(skew, skew, s_xy * s_xy)), tiny);
  const T first = half * (s_xx + s_yy) + radius;
  const T root = n_xx * n_yy;
  const T larger = max(first - one, zero), smaller = max(root * root / first - one, zero);
  const T sum = radius + max(abs(skew), tiny);
  const T major = half * sum / radius, mixed = half * s_xy / radius, minor = mixed * (s_xy / sum);
  // I + (S - I)+, whitened as whitening() does it, on top of `a`.
  const T yy = one + select(skew < zero, mul_add(larger, major, smaller * minor),
                            mul_add(larger, minor, smaller * major));
  const T xy = (larger - smaller) * mixed;
  const T root_yy = sqrt(yy);
  const T k = one / (root_yy * sqrt((one + larger) * (one + smaller)));
  return {yy * k * a.xx, k * (yy * a.xy - xy * a.yy), a.yy / root_yy};
}

/// An ellipse swept along a straight path: the sum of the ellipse and the segment from 0 to
/// `displacement`, prepared for being cut into bands of rows. Positions are relative to the
/// ellipse's centre at the start of the path.
template <class T>
struct Trail {
  Ellipse<T> ellipse;
  Vec2<T> displacement;  // px; y is never 0
  T inverse_dy;
  T tangent_y;        // dy of the point on the ellipse's right edge whose tangent is the path
  T top_y, bottom_y;  // rows that the trail covers
  T rightmost_y, leftmost_y;
};

/// `ellipse` as make_ellipse() returns it, `displacement` in px and finite. A displacement of zero
/// gives the ellipse.
///
/// A path along the rows is tilted by a millionth of a pixel, so that it needs no formulas of its
/// own. As with ellipses, the reach is widened by what rounding can add.
template <class T>
CATGS_HD_INLINE Trail<T> make_trail(const Ellipse<T>& ellipse, const Vec2<T>& displacement) {
  const T zero = T(0.0), least_dy = T(1e-6);
  Trail<T> t;
  t.ellipse = ellipse;
  const Whitening<T>& w = t.ellipse.w;
  t.displacement.x = displacement.x;
  t.displacement.y = select(abs(displacement.y) < least_dy, least_dy, displacement.y);
  const T dx = t.displacement.x, dy = t.displacement.y;
  t.ellipse.reach =
      max(ellipse.reach, zero) + T(3e-6) * mul_add(w.xx, abs(dx), (abs(w.xy) + w.yy) * abs(dy));
  t.inverse_dy = T(1.0) / dy;

  // In the whitened plane the ellipse is a circle. The tangent is parallel to the path (u, v) at
  // the circle's point (-v, u) r / |(u, v)| and at the opposite one; this takes the one with x on
  // the right.
  const T u = mul_add(w.xx, dx, w.xy * dy);
  const T v = w.yy * dy;
  const T half_height = sqrt(t.ellipse.reach) / w.yy;
  const T towards_right = select(dy < zero, u, -u);
  t.tangent_y = towards_right * half_height / sqrt(mul_add(u, u, v * v));

  const T up = min(dy, zero), down = max(dy, zero);
  t.top_y = up - half_height;
  t.bottom_y = down + half_height;
  // The trail reaches farthest where the ellipse does, at the end of the path that is farther out.
  t.rightmost_y = ellipse.rightmost_y + select(dx > zero, dy, zero);
  t.leftmost_y = select(dx > zero, zero, dy) - ellipse.rightmost_y;
  return t;
}

template <class T, class S>
CATGS_HD_INLINE Trail<T> convert(const Trail<S>& t) {
  return {convert<T>(t.ellipse),
          convert<T>(t.displacement),
          T(t.inverse_dy),
          T(t.tangent_y),
          T(t.top_y),
          T(t.bottom_y),
          T(t.rightmost_y),
          T(t.leftmost_y)};
}

/// Columns dx that the trail covers within the rows low_y <= dy <= high_y. Exact, as
/// columns_in_band() of an ellipse is, and for the same reason: the trail is convex.
///
/// The right edge of a sum of convex sets is concave in y, so it is farthest out in the band at the
/// row nearest to its peak. There it is the maximum over shares s of the path of s dx + the
/// ellipse's edge at y - s dy, which is again concave: the best s is the one nearest to where the
/// edge runs along the path. The left edge mirrors this.
template <class T>
CATGS_HD_INLINE Interval<T> columns_in_band(const Trail<T>& t, T low_y, T high_y) {
  const Whitening<T>& w = t.ellipse.w;
  const T zero = T(0.0), one = T(1.0);
  const T right_y = clamp(t.rightmost_y, low_y, high_y);
  const T left_y = clamp(t.leftmost_y, low_y, high_y);
  const T right_share = clamp((right_y - t.tangent_y) * t.inverse_dy, zero, one);
  const T left_share = clamp((left_y + t.tangent_y) * t.inverse_dy, zero, one);
  const T right_dy = right_y - right_share * t.displacement.y;  // from the ellipse's centre there
  const T left_dy = left_y - left_share * t.displacement.y;
  const T right_chord = sqrt(max(t.ellipse.reach - w.yy * right_dy * w.yy * right_dy, zero));
  const T left_chord = sqrt(max(t.ellipse.reach - w.yy * left_dy * w.yy * left_dy, zero));
  const T right = mul_add(right_share, t.displacement.x,
                          (right_chord - w.xy * right_dy) * t.ellipse.inverse_xx);
  const T left =
      mul_add(left_share, t.displacement.x, (-left_chord - w.xy * left_dy) * t.ellipse.inverse_xx);
  const auto hit = (t.top_y <= high_y) & (low_y <= t.bottom_y);
  return {select(hit, left, one), select(hit, right, -one)};
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
