#if defined(CATGS_MATH_PROJECTION_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_PROJECTION_INL_H
#undef CATGS_MATH_PROJECTION_INL_H
#else
#define CATGS_MATH_PROJECTION_INL_H
#endif

#include "render_core/math/camera-inl.h"
#include "render_core/math/number-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

/// Lower triangle L of a 3D covariance Sigma = L L^T, world axes, world units.
template <class T>
struct CovarianceFactor {
  T xx, yx, yy, zx, zy, zz;
};

/// Factor of Sigma = R diag(scale^2) R^T, from the rows of R diag(scale) by Gram-Schmidt. It is
/// never formed from Sigma itself, which would square the axis ratio of needles and flakes.
/// `rotation` holds (x, y, z, w), unit length.
template <class T>
CATGS_HD_INLINE CovarianceFactor<T> covariance_factor(const T (&rotation)[4],
                                                      const Vec3<T>& scale) {
  const T x = rotation[0], y = rotation[1], z = rotation[2], w = rotation[3];
  const T two = T(2.0), one = T(1.0);
  const Vec3<T> row_x{(one - two * (y * y + z * z)) * scale.x, two * (x * y - w * z) * scale.y,
                      two * (x * z + w * y) * scale.z};
  const Vec3<T> row_y{two * (x * y + w * z) * scale.x, (one - two * (x * x + z * z)) * scale.y,
                      two * (y * z - w * x) * scale.z};
  const Vec3<T> row_z{two * (x * z - w * y) * scale.x, two * (y * z + w * x) * scale.y,
                      (one - two * (x * x + y * y)) * scale.z};
  const T tiny = T(1e-30);  // a row may vanish when scales are
  CovarianceFactor<T> l;
  l.xx = sqrt(dot(row_x, row_x));
  const Vec3<T> axis_0 = row_x * (one / max(l.xx, tiny));
  l.yx = dot(row_y, axis_0);
  const Vec3<T> rest_y = row_y - axis_0 * l.yx;
  l.yy = sqrt(dot(rest_y, rest_y));
  const Vec3<T> axis_1 = rest_y * (one / max(l.yy, tiny));
  l.zx = dot(row_z, axis_0);
  l.zy = dot(row_z, axis_1);
  const Vec3<T> rest_z = row_z - axis_0 * l.zx - axis_1 * l.zy;
  l.zz = sqrt(dot(rest_z, rest_z));
  return l;
}

template <class T>
CATGS_HD_INLINE Vec3<T> operator*(const Vec3<T>& row, const CovarianceFactor<T>& l) {
  return {mul_add(row.x, l.xx, mul_add(row.y, l.yx, row.z * l.zx)),
          mul_add(row.y, l.yy, row.z * l.zy), row.z * l.zz};
}

/// A Gaussian in the image plane, before opacity and colour.
template <class T>
struct ProjectedGaussian {
  Vec2<T> centre_px;
  // Covariance [[xx, xy], [xy, yy]] with the low-pass added, px^2, and its determinant.
  T xx, xy, yy, determinant;
  T sharp_determinant;  // of the covariance without the low-pass
};

/// EWA projection (Zwicker et al. 2001): Sigma2 = J W Sigma W^T J^T + low_pass I, J the Jacobian of
/// the perspective projection at the centre clamped to the field of view. An orthographic
/// projection is linear, and exact. `depth` is view_depth() > 0.
///
/// Works on the square root M = J W L, so that the determinant is a sum of positive terms
/// (Cauchy-Binet): |m_u x m_v|^2 + low_pass (|m_u|^2 + |m_v|^2) + low_pass^2. The textbook
/// xx yy - xy^2 loses all digits in float for a needle a thousand pixels long.
template <class T>
CATGS_HD_INLINE ProjectedGaussian<T> project(const CameraModel<T>& camera, const Vec3<T>& mean,
                                             const CovarianceFactor<T>& l, T depth) {
  const Vec3<T> offset = mean - camera.position;
  const T inverse_depth = T(1.0) / perspective_divisor(camera, depth);
  const Vec2<T> slope{dot(camera.right, offset) * inverse_depth,
                      dot(camera.down, offset) * inverse_depth};

  ProjectedGaussian<T> out;
  out.centre_px = {mul_add(camera.focal_px.x, slope.x, camera.principal_point_px.x),
                   mul_add(camera.focal_px.y, slope.y, camera.principal_point_px.y)};

  const T u = camera.z_weight * clamp(slope.x, camera.slope_min.x, camera.slope_max.x);
  const T v = camera.z_weight * clamp(slope.y, camera.slope_min.y, camera.slope_max.y);
  const Vec3<T> jw_u =
      (camera.right - camera.forward * u) * (camera.focal_px.x * inverse_depth);  // J W, row u
  const Vec3<T> jw_v = (camera.down - camera.forward * v) * (camera.focal_px.y * inverse_depth);
  const Vec3<T> m_u = jw_u * l;
  const Vec3<T> m_v = jw_v * l;

  const T low_pass = T(low_pass_px2);
  const T uu = dot(m_u, m_u);
  const T vv = dot(m_v, m_v);
  const Vec3<T> area = cross(m_u, m_v);
  out.xx = uu + low_pass;
  out.xy = dot(m_u, m_v);
  out.yy = vv + low_pass;
  out.sharp_determinant = dot(area, area);
  out.determinant = out.sharp_determinant + low_pass * (uu + vv + low_pass);
  return out;
}

/// The opacity of a Gaussian of an antialiased scene, as a base-2 logarithm. The low-pass filter
/// spreads the Gaussian over more of the picture, so its peak sinks by the ratio of the areas:
/// sqrt(det Sigma2 / det (Sigma2 + low_pass I)). Source: the 2D filter of
/// Mip-Splatting (Yu et al. 2024).
template <class T>
CATGS_HD_INLINE T antialiased_log2_opacity(T log2_opacity, const ProjectedGaussian<T>& g) {
  const T least = T(2.3e-10);  // 2^-32: invisible at any opacity
  return mul_add(T(0.5), log2_of_share(max(g.sharp_determinant / g.determinant, least)),
                 log2_opacity);
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
