#if defined(CATGS_MATH_SPHERICAL_HARMONICS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_SPHERICAL_HARMONICS_INL_H
#undef CATGS_MATH_SPHERICAL_HARMONICS_INL_H
#else
#define CATGS_MATH_SPHERICAL_HARMONICS_INL_H
#endif

#include "render_core/math/constants.h"
#include "render_core/math/number-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

/// Real spherical harmonics up to `degree` (0…3) in direction d (unit length, from the camera to
/// the Gaussian, world axes), in the order and with the signs of the original 3DGS.
template <class T>
CATGS_HD_INLINE void sh_basis(const Vec3<T>& d, int degree, T (&basis)[16]) {
  basis[0] = T(sh_basis_0);
  if (degree < 1) return;
  const T x = d.x, y = d.y, z = d.z;
  basis[1] = T(-0.4886025119029199) * y;
  basis[2] = T(0.4886025119029199) * z;
  basis[3] = T(-0.4886025119029199) * x;
  if (degree < 2) return;
  const T xx = x * x, yy = y * y, zz = z * z;
  const T xy = x * y, yz = y * z, xz = x * z;
  basis[4] = T(1.0925484305920792) * xy;
  basis[5] = T(-1.0925484305920792) * yz;
  basis[6] = T(0.31539156525252005) * (zz + zz - xx - yy);
  basis[7] = T(-1.0925484305920792) * xz;
  basis[8] = T(0.5462742152960396) * (xx - yy);
  if (degree < 3) return;
  const T three = T(3.0), four = T(4.0);
  basis[9] = T(-0.5900435899266435) * y * (three * xx - yy);
  basis[10] = T(2.890611442640554) * xy * z;
  basis[11] = T(-0.4570457994644658) * y * (four * zz - xx - yy);
  basis[12] = T(0.3731763325901154) * z * (zz + zz - three * (xx + yy));
  basis[13] = T(-0.4570457994644658) * x * (four * zz - xx - yy);
  basis[14] = T(1.445305721320277) * z * (xx - yy);
  basis[15] = T(-0.5900435899266435) * x * (xx - three * yy);
}

/// Direction in which a camera at `position` sees `mean`.
template <class T>
CATGS_HD_INLINE Vec3<T> view_direction(const Vec3<T>& position, const Vec3<T>& mean) {
  const Vec3<T> offset = mean - position;
  return offset * (T(1.0) / sqrt(max(dot(offset, offset), T(1e-30))));
}

/// One channel of a Gaussian's colour from its harmonic sum; negative light is cut, as in training.
template <class T>
CATGS_HD_INLINE T colour_from_sh_sum(T sum) {
  return max(T(0.5) + sum, T(0.0));
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
