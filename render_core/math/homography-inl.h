#if defined(CATGS_MATH_HOMOGRAPHY_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_HOMOGRAPHY_INL_H
#undef CATGS_MATH_HOMOGRAPHY_INL_H
#else
#define CATGS_MATH_HOMOGRAPHY_INL_H
#endif

#include "render_core/math/number-inl.h"
#include "render_core/math/plane_maps.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

template <class T, class S>
CATGS_HD_INLINE Homography<T> convert(const Homography<S>& h) {
  return {T(h.xx), T(h.xy), T(h.x), T(h.yx), T(h.yy), T(h.y), T(h.wx), T(h.wy), T(h.w)};
}

/// The inverse map, for maps that have one; weights keep their sign.
template <class T>
CATGS_HD_INLINE Homography<T> inverse(const Homography<T>& h) {
  const Vec3<T> x{h.xx, h.xy, h.x}, y{h.yx, h.yy, h.y}, w{h.wx, h.wy, h.w};
  const T scale = T(1.0) / dot(x, cross(y, w));
  const Vec3<T> a = cross(y, w) * scale, b = cross(w, x) * scale, c = cross(x, y) * scale;
  return {a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z};
}

/// The denominator at a point: positive in front of the other camera, 1 / w^3 the growth of areas.
template <class T>
CATGS_HD_INLINE T weight_at(const Homography<T>& h, const Vec2<T>& p) {
  return mul_add(h.wx, p.x, mul_add(h.wy, p.y, h.w));
}

/// Image of a point whose weight_at() is positive.
template <class T>
CATGS_HD_INLINE Vec2<T> apply(const Homography<T>& h, const Vec2<T>& p) {
  const T scale = T(1.0) / weight_at(h, p);
  return {mul_add(h.xx, p.x, mul_add(h.xy, p.y, h.x)) * scale,
          mul_add(h.yx, p.x, mul_add(h.yy, p.y, h.y)) * scale};
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
