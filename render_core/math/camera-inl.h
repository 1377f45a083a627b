#if defined(CATGS_MATH_CAMERA_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_CAMERA_INL_H
#undef CATGS_MATH_CAMERA_INL_H
#else
#define CATGS_MATH_CAMERA_INL_H
#endif

#include "render_core/math/camera.h"
#include "render_core/math/constants.h"
#include "render_core/math/number-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

/// One pair of sides of a ClipBox.
template <class T>
struct ClipSides {
  Vec3<T> axis;
  T low, high;
};

/// A Camera prepared for projection. Rows of camera_from_world are camera axes in the world.
template <class T>
struct CameraModel {
  Vec3<T> position;  // world
  Vec3<T> eye;       // world: where colours are seen from
  Vec3<T> right, down, forward;
  Vec2<T> focal_px, principal_point_px;
  T near_z;
  ClipSides<T> clip[3];
  // A point at depth z is drawn at 1 / (z_weight z + z_offset) of its size: (1, 0), or (0, 1) where
  // rays are parallel.
  T z_weight, z_offset;
  // Range of x/z and y/z in which the projection is linearised (fov_clamp).
  Vec2<T> slope_min, slope_max;
};

/// Built in double so that every core starts from the same numbers.
inline CameraModel<double> make_camera_model(const Camera& camera) {
  const glm::dquat q = glm::normalize(glm::dquat(camera.world_from_camera.orientation));
  const glm::dmat3 world_from_camera = glm::mat3_cast(q);
  const auto vec3 = [](const glm::dvec3& v) { return Vec3<double>{v.x, v.y, v.z}; };
  const glm::dvec2 focal(camera.focal_px);
  const glm::dvec2 centre(camera.principal_point_px);
  const bool whole = camera.crop.whole_px == glm::ivec2(0);
  const glm::dvec2 size(whole ? camera.size_px : camera.crop.whole_px);
  const glm::dvec2 corner = -glm::dvec2(camera.crop.from_px);
  // With a centred principal point this is +-1.3 tan(fov / 2); else the same margin on both sides.
  const glm::dvec2 margin = (fov_clamp - 1.0) * 0.5 * size / focal;
  const glm::dvec2 low = (corner - centre) / focal - margin;
  const glm::dvec2 high = (corner + size - centre) / focal + margin;
  const auto sides = [&](int i) {
    return ClipSides<double>{vec3(glm::dvec3(camera.clip.axes[i])),
                             static_cast<double>(camera.clip.low[i]),
                             static_cast<double>(camera.clip.high[i])};
  };
  return {vec3(glm::dvec3(camera.world_from_camera.position)),
          vec3(glm::dvec3(colour_eye(camera))),
          vec3(world_from_camera[0]),
          vec3(world_from_camera[1]),
          vec3(world_from_camera[2]),
          {focal.x, focal.y},
          {centre.x, centre.y},
          static_cast<double>(camera.near_z),
          {sides(0), sides(1), sides(2)},
          camera.orthographic ? 0.0 : 1.0,
          camera.orthographic ? 1.0 : 0.0,
          {low.x, low.y},
          {high.x, high.y}};
}

template <class T, class S>
CATGS_HD_INLINE ClipSides<T> convert(const ClipSides<S>& sides) {
  return {convert<T>(sides.axis), T(sides.low), T(sides.high)};
}

template <class T, class S>
CATGS_HD_INLINE CameraModel<T> convert(const CameraModel<S>& c) {
  return {convert<T>(c.position),
          convert<T>(c.eye),
          convert<T>(c.right),
          convert<T>(c.down),
          convert<T>(c.forward),
          convert<T>(c.focal_px),
          convert<T>(c.principal_point_px),
          T(c.near_z),
          {convert<T>(c.clip[0]), convert<T>(c.clip[1]), convert<T>(c.clip[2])},
          T(c.z_weight),
          T(c.z_offset),
          convert<T>(c.slope_min),
          convert<T>(c.slope_max)};
}

/// Distance along the view axis, world units. Every core evaluates it in double and rounds it to
/// float: this number decides the blending order, which must be the same everywhere.
template <class T>
CATGS_HD_INLINE T view_depth(const CameraModel<T>& camera, const Vec3<T>& mean) {
  return dot(camera.forward, mean - camera.position);
}

/// Whether the clip box leaves a Gaussian with this centre in.
template <class T>
CATGS_HD_INLINE auto is_kept(const CameraModel<T>& camera, const Vec3<T>& mean) {
  const auto between = [&](const ClipSides<T>& sides) {
    const T at = dot(sides.axis, mean);
    return (sides.low <= at) & (at <= sides.high);
  };
  return between(camera.clip[0]) & between(camera.clip[1]) & between(camera.clip[2]);
}

/// The divisor of positions beside the view axis at a view depth: the depth itself, or 1 where rays
/// are parallel.
template <class T>
CATGS_HD_INLINE T perspective_divisor(const CameraModel<T>& camera, T depth) {
  return mul_add(camera.z_weight, depth, camera.z_offset);
}

/// A point of the world in camera space.
template <class T>
CATGS_HD_INLINE Vec3<T> camera_from_world(const CameraModel<T>& camera, const Vec3<T>& point) {
  const Vec3<T> offset = point - camera.position;
  return {dot(camera.right, offset), dot(camera.down, offset), dot(camera.forward, offset)};
}

/// Image of a point in camera space, z > 0.
template <class T>
CATGS_HD_INLINE Vec2<T> image_px(const CameraModel<T>& camera, const Vec3<T>& point) {
  const T inverse_depth = T(1.0) / perspective_divisor(camera, point.z);
  return {mul_add(camera.focal_px.x, point.x * inverse_depth, camera.principal_point_px.x),
          mul_add(camera.focal_px.y, point.y * inverse_depth, camera.principal_point_px.y)};
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
