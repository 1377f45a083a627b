#if defined(CATGS_CPU_SWEEP_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_SWEEP_INL_H
#undef CATGS_CPU_SWEEP_INL_H
#else
#define CATGS_CPU_SWEEP_INL_H
#endif

#include <bit>
#include <cstring>

#include "render_core/cpu/splats-inl.h"
#include "render_core/math/trail-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

/// Gaussians on their way through a window.
struct Sweep {
  // Now; of those behind the near plane now, at the window's end.
  ProjectedGaussian<Floats> shape;
  Vec2<Floats> displacement;  // from there on, px
  Whitening<Floats> outline;  // stays around it on the way
};

/// The sweep of Gaussians that are drawn at one end of the window only: from there to the near
/// plane, growing as they come nearer. `shape`: at that end.
HWY_INLINE Sweep sweep_to_near_plane(const CameraModel<Floats>& camera,
                                     const ProjectedGaussian<Floats>& shape,
                                     const Vec3<Floats>& drawn, const Vec3<Floats>& hidden) {
  const Vec2<Floats> cut = image_px(camera, cut_at_near(drawn, hidden, camera.near_z));
  const Whitening<Floats> w = whitening(shape);
  const Floats shrink = min(camera.near_z / drawn.z, Floats(1.0));
  return {shape,
          {cut.x - shape.centre_px.x, cut.y - shape.centre_px.y},
          {w.xx * shrink, w.xy * shrink, w.yy * shrink}};
}

HWY_INLINE Sweep select(const FloatMask& mask, const Sweep& a, const Sweep& b) {
  const auto pick = [&](const Floats& if_true, const Floats& if_false)
                        HWY_ATTR { return select(mask, if_true, if_false); };
  return {{{pick(a.shape.centre_px.x, b.shape.centre_px.x),
            pick(a.shape.centre_px.y, b.shape.centre_px.y)},
           pick(a.shape.xx, b.shape.xx),
           pick(a.shape.xy, b.shape.xy),
           pick(a.shape.yy, b.shape.yy),
           pick(a.shape.determinant, b.shape.determinant)},
          {pick(a.displacement.x, b.displacement.x), pick(a.displacement.y, b.displacement.y)},
          {pick(a.outline.xx, b.outline.xx), pick(a.outline.xy, b.outline.xy),
           pick(a.outline.yy, b.outline.yy)}};
}

/// Of Gaussians in front of the near plane now (their view_depth() is `depth`) or at the end.
HWY_INLINE Sweep sweep(const CameraModel<Floats>& now, const CameraModel<Floats>& end,
                       const Vec3<Floats>& mean, const CovarianceFactor<Floats>& factor,
                       const Floats& depth) {
  const Vec3<Floats> at_end = camera_from_world(end, mean);
  const auto first = project(now, mean, factor, max(depth, now.near_z));
  const auto last = project(end, mean, factor, max(at_end.z, now.near_z));
  const Sweep s{first,
                {last.centre_px.x - first.centre_px.x, last.centre_px.y - first.centre_px.y},
                whitening_of_both(whitening(first), whitening(last))};
  const auto comes = depth <= now.near_z, goes = at_end.z <= now.near_z;
  if (none(comes | goes)) return s;
  const Vec3<Floats> at_start = camera_from_world(now, mean);
  const Sweep coming = sweep_to_near_plane(now, last, at_end, at_start);
  const Sweep going = sweep_to_near_plane(now, first, at_start, at_end);
  return select(comes, coming, select(goes, going, s));
}

/// Writes the path of each hit, one after the other. `half_extent_x`: of the outline.
HWY_INLINE void write_paths(const Sweep& s, const Floats& log2_opacity, const Floats& reach,
                            const Floats& half_extent_x, std::uint32_t hits, SplatPath* out) {
  const hn::ScalableTag<float> d;
  alignas(64) float quads[2][4 * Floats::count];
  hn::StoreInterleaved4(s.displacement.x.v, s.displacement.y.v, s.outline.xx.v, s.outline.xy.v, d,
                        quads[0]);
  hn::StoreInterleaved4(s.outline.yy.v, log2_opacity.v, half_extent_x.v,
                        rightmost_y(s.outline, reach).v, d, quads[1]);
  for (; hits != 0; hits &= hits - 1, ++out) {
    const int lane = std::countr_zero(hits);
    std::memcpy(&out->dx, quads[0] + lane * 4, 16);
    std::memcpy(&out->whitening_yy, quads[1] + lane * 4, 16);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif
