#if defined(CATGS_MATH_SWEEP_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_SWEEP_INL_H
#undef CATGS_MATH_SWEEP_INL_H
#else
#define CATGS_MATH_SWEEP_INL_H
#endif

#include "render_core/math/projection-inl.h"
#include "render_core/math/trail-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

/// A Gaussian on its way through a window.
template <class T>
struct Sweep {
  // At the start; at the window's end for a Gaussian behind the near plane at the start.
  ProjectedGaussian<T> shape;
  Vec2<T> displacement;  // from `shape` to the other end, px
  Whitening<T> outline;  // holds the Gaussian all along the way
};

/// The sweep of a Gaussian that is drawn at one end of the window only. It goes from that end to
/// the near plane, and grows on the way. `shape`: at that end.
template <class T>
CATGS_HD_INLINE Sweep<T> sweep_to_near_plane(const CameraModel<T>& camera,
                                             const ProjectedGaussian<T>& shape,
                                             const Vec3<T>& drawn, const Vec3<T>& hidden) {
  const Vec2<T> cut = image_px(camera, cut_at_near(drawn, hidden, camera.near_z));
  const Whitening<T> w = whitening(shape);
  const T shrink = min(camera.near_z / drawn.z, T(1.0));
  return {shape,
          {cut.x - shape.centre_px.x, cut.y - shape.centre_px.y},
          {w.xx * shrink, w.xy * shrink, w.yy * shrink}};
}

template <class T, class Mask>
CATGS_HD_INLINE Sweep<T> choose(const Mask& mask, const Sweep<T>& a, const Sweep<T>& b) {
  return {{{select(mask, a.shape.centre_px.x, b.shape.centre_px.x),
            select(mask, a.shape.centre_px.y, b.shape.centre_px.y)},
           select(mask, a.shape.xx, b.shape.xx),
           select(mask, a.shape.xy, b.shape.xy),
           select(mask, a.shape.yy, b.shape.yy),
           select(mask, a.shape.determinant, b.shape.determinant),
           select(mask, a.shape.sharp_determinant, b.shape.sharp_determinant)},
          {select(mask, a.displacement.x, b.displacement.x),
           select(mask, a.displacement.y, b.displacement.y)},
          {select(mask, a.outline.xx, b.outline.xx), select(mask, a.outline.xy, b.outline.xy),
           select(mask, a.outline.yy, b.outline.yy)}};
}

/// The sweep of a Gaussian in front of the near plane at the start (its view_depth() is `depth`) or
/// at the end.
template <class T>
CATGS_HD_INLINE Sweep<T> sweep(const CameraModel<T>& now, const CameraModel<T>& end,
                               const Vec3<T>& mean, const CovarianceFactor<T>& factor,
                               const T& depth) {
  const Vec3<T> at_end = camera_from_world(end, mean);
  const auto first = project(now, mean, factor, max(depth, now.near_z));
  const auto last = project(end, mean, factor, max(at_end.z, now.near_z));
  const Sweep<T> s{first,
                   {last.centre_px.x - first.centre_px.x, last.centre_px.y - first.centre_px.y},
                   whitening_of_both(whitening(first), whitening(last))};
  const auto comes = depth <= now.near_z;
  const auto goes = at_end.z <= now.near_z;
  if (none(comes) && none(goes)) return s;
  const Vec3<T> at_start = camera_from_world(now, mean);
  const Sweep<T> coming = sweep_to_near_plane(now, last, at_end, at_start);
  const Sweep<T> going = sweep_to_near_plane(now, first, at_start, at_end);
  return choose(comes, coming, choose(goes, going, s));
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
