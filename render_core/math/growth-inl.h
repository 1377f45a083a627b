#if defined(CATGS_MATH_GROWTH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_GROWTH_INL_H
#undef CATGS_MATH_GROWTH_INL_H
#else
#define CATGS_MATH_GROWTH_INL_H
#endif

#include "render_core/math/number-inl.h"
#include "render_core/math/plane_maps.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

template <class T, class S>
CATGS_HD_INLINE ListGrowth<T> convert(const ListGrowth<S>& g) {
  return {T(g.parallax),    T(g.curvature),   T(g.constant),    T(g.wide),
          T(g.slope_min_x), T(g.slope_min_y), T(g.slope_max_x), T(g.slope_max_y),
          T(g.turn_sine),   T(g.turn_cosine), T(g.steepest),    T(g.oblique)};
}

/// Growth in px of an outline of `radius_px` around a centre at `slope` = (x/z, y/z), whose depth
/// does not fall below `nearest_depth` on its way (world units).
///
/// A camera that is tau off its path sees a point displaced by at most f tau sqrt(1 + |slope|^2) /
/// z. A turn maps the image by a homography H. To first order the projection of a Gaussian follows
/// H (chain rule); the second order is at most 1/2 |D^2 H| radius^2.
template <class T>
CATGS_HD_INLINE T growth_px(const ListGrowth<T>& g, const Vec2<T>& slope, T nearest_depth,
                            T radius_px) {
  const T oblique = sqrt(mul_add(slope.x, slope.x, mul_add(slope.y, slope.y, T(1.0))));
  const auto wide = (slope.x < g.slope_min_x) | (slope.x > g.slope_max_x) |
                    (slope.y < g.slope_min_y) | (slope.y > g.slope_max_y);
  const T by_radius = mul_add(g.curvature, radius_px, select(wide, g.wide, T(0.0)));
  return mul_add(by_radius, radius_px, g.parallax * oblique / nearest_depth) + g.constant;
}

/// Whether a turn may bring a Gaussian into the picture that lies behind the near plane on the
/// camera's path, at `at` in camera space. Such a Gaussian comes before that plane far to the side,
/// where its footprint, linearised at the clamped slope (fov_clamp), is huge. `extent`: the largest
/// distance from its centre at which it reaches alpha_min, world units. True only for giants and
/// for Gaussians around the camera.
template <class T>
CATGS_HD_INLINE auto may_turn_in(const ListGrowth<T>& g, const Vec3<T>& at, T extent, T near_z) {
  const T lateral2 = mul_add(at.x, at.x, at.y * at.y);
  const T z = mul_add(g.turn_cosine, at.z, g.turn_sine * sqrt(lateral2));
  const T aside = sqrt(max(mul_add(at.z, at.z, lateral2) - z * z, T(0.0)));
  return (z > near_z) & (aside <= mul_add(g.oblique, extent, g.steepest * z));
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
