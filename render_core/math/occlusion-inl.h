#if defined(CATGS_MATH_OCCLUSION_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_OCCLUSION_INL_H
#undef CATGS_MATH_OCCLUSION_INL_H
#else
#define CATGS_MATH_OCCLUSION_INL_H
#endif

#include <cmath>

#include "render_core/math/camera-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

// The last picture shows what is hidden in the next one. It keeps the *end* of each part: the view
// depth behind which nothing of it shows. The next picture gets a *limit* for each of its parts,
// and leaves out Gaussians behind the limits of all parts that they meet. Depths are view depths in
// world units. Infinity means that nothing is hidden.

/// Parts around a place whose ends count there: 1 for a still camera, and more with the parallax of
/// its step. -1 where the last picture hides nothing: after a larger step or another clip box,
/// where rays are parallel, or where no depth is known. `mean_inverse_depth`: of what the last
/// picture drew, 1 / world units; 0: not known.
template <class T>
CATGS_HD_INLINE int occlusion_radius(const CameraModel<T>& now, const CameraModel<T>& last,
                                     T mean_inverse_depth, int part_px) {
  const Vec3<T> step = now.position - last.position;
  if (now.z_offset + last.z_offset > T(0.0)) return -1;
  for (int i = 0; i < 3; ++i) {
    const ClipSides<T>&a = now.clip[i], &b = last.clip[i];
    const Vec3<T> turn = a.axis - b.axis;
    if (dot(turn, turn) > T(0.0) || a.low != b.low || a.high != b.high) return -1;
  }
  // How far near surfaces move against those behind them. With parts of the place alone (radius 0),
  // blocks fell to 13 dB where surfaces came out behind others.
  const T focal_px = max(now.focal_px.x, now.focal_px.y);
  const T parallax_px = T(2.0) * focal_px * mean_inverse_depth * sqrt(dot(step, step));
  if (!(mean_inverse_depth > T(0.0) && parallax_px < T(most_occlusion_px))) return -1;
  return 1 + static_cast<int>(parallax_px / T(part_px));
}

/// A pixel's ray in the space of another camera: offset + depth * direction, with the depth along
/// the pixel's own view axis.
template <class T>
struct CarriedRay {
  Vec3<T> offset, direction;

  CATGS_HD_INLINE Vec3<T> at(T depth) const {
    return {mul_add(depth, direction.x, offset.x), mul_add(depth, direction.y, offset.y),
            mul_add(depth, direction.z, offset.z)};
  }
};

template <class T>
CATGS_HD_INLINE CarriedRay<T> carried_ray(const CameraModel<T>& now, const CameraModel<T>& last,
                                          const Vec2<T>& pixel) {
  const T x = (pixel.x - now.principal_point_px.x) / now.focal_px.x;
  const T y = (pixel.y - now.principal_point_px.y) / now.focal_px.y;
  const Vec3<T> ray{mul_add(x, now.right.x, mul_add(y, now.down.x, now.forward.x)),
                    mul_add(x, now.right.y, mul_add(y, now.down.y, now.forward.y)),
                    mul_add(x, now.right.z, mul_add(y, now.down.z, now.forward.z))};
  return {camera_from_world(last, now.position),
          {dot(last.right, ray), dot(last.down, ray), dot(last.forward, ray)}};
}

/// The limit of a part with this middle. Its ray is followed into the last picture, to the depth at
/// which that picture ends. deepest_end(x_px, y_px) is the deepest end of the parts around a place
/// in the last picture, so that surfaces which come out behind others are drawn. It is infinite
/// beyond that picture's edge, and for places that are not numbers.
template <class T, class DeepestEnd>
CATGS_HD_INLINE T occlusion_limit(const CameraModel<T>& now, const CameraModel<T>& last,
                                  const Vec2<T>& middle_px, const DeepestEnd& deepest_end) {
  const T unknown = T(INFINITY), zero = T(0.0);
  const CarriedRay<T> ray = carried_ray(now, last, middle_px);
  const auto end_at = [&](const Vec3<T>& point) {
    const Vec2<T> position = image_px(last, point);
    return select(point.z > zero, deepest_end(position.x, position.y), unknown);
  };
  T end = end_at(ray.direction);  // where the ray's far end was
  constexpr int steps = 2;
  for (int step = 0; step < steps; ++step)
    end = max(end, end_at(ray.at((end - ray.offset.z) / ray.direction.z)));
  // The camera may have moved past the place where the last picture ended.
  const auto known = (ray.direction.z > zero) & (end > ray.offset.z);
  return select(known, T(1.0 + occlusion_margin) * (end - ray.offset.z) / ray.direction.z, unknown);
}

/// A box in the picture that holds all that a cluster may draw, px, and its least view depth. The
/// depth is 0 where the cluster comes to the near plane.
template <class T>
struct ClusterBox {
  Vec2<T> low_px, high_px;
  T nearest;
};

/// `centre` and `half_extent`: of the box around the means, world. `reach`: how far beyond them the
/// Gaussians reach, world units; see ClusterCuller.
template <class T>
CATGS_HD_INLINE ClusterBox<T> cluster_box(const CameraModel<T>& camera, const Vec3<T>& centre,
                                          const Vec3<T>& half_extent, T reach) {
  const auto along = [&](const Vec3<T>& axis) {
    return abs(axis.x) * half_extent.x + abs(axis.y) * half_extent.y + abs(axis.z) * half_extent.z;
  };
  const Vec3<T> at = camera_from_world(camera, centre);
  const T nearest = at.z - along(camera.forward), farthest = at.z + along(camera.forward);
  if (!(nearest > camera.near_z)) return {{T(0.0), T(0.0)}, {T(0.0), T(0.0)}, T(0.0)};
  // The low-pass filter's part of a splat's reach, and a pixel for rounding.
  constexpr double blur_px = 1.83, ln_2 = 0.6931471805599453;
  static_assert(blur_px * blur_px > -2.0 * ln_2 * log2_alpha_min * low_pass_px2);
  const auto interval = [&](T middle, T half, T focal, T principal, T low_slope, T high_slope) {
    const T low = middle - half, high = middle + half;
    const T steepest = max(abs(low_slope), abs(high_slope));
    const T beyond =
        T(blur_px + 1.0) + focal * sqrt(T(1.0) + steepest * steepest) * reach / nearest;
    return Vec2<T>{focal * (low / (low < T(0.0) ? nearest : farthest)) + principal - beyond,
                   focal * (high / (high < T(0.0) ? farthest : nearest)) + principal + beyond};
  };
  const Vec2<T> x = interval(at.x, along(camera.right), camera.focal_px.x,
                             camera.principal_point_px.x, camera.slope_min.x, camera.slope_max.x);
  const Vec2<T> y = interval(at.y, along(camera.down), camera.focal_px.y,
                             camera.principal_point_px.y, camera.slope_min.y, camera.slope_max.y);
  return {{x.x, y.x}, {x.y, y.y}, nearest};
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
