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
  Floats growth;              // as in SplatPath
};

/// The sweep of Gaussians that are drawn at one end of the window only: from there to the near
/// plane, growing as they come nearer. `shape`: at that end.
HWY_INLINE Sweep sweep_to_near_plane(const CameraModel<Floats>& camera,
                                     const ProjectedGaussian<Floats>& shape,
                                     const Vec3<Floats>& drawn, const Vec3<Floats>& hidden) {
  const Vec2<Floats> cut = image_px(camera, cut_at_near(drawn, hidden, camera.near_z));
  return {shape,
          {cut.x - shape.centre_px.x, cut.y - shape.centre_px.y},
          max(drawn.z / camera.near_z, Floats(1.0))};
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
          pick(a.growth, b.growth)};
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
                max(growth_between(whitening(first), whitening(last)), Floats(1.0))};
  const auto comes = depth <= now.near_z, goes = at_end.z <= now.near_z;
  if (none(comes | goes)) return s;
  const Vec3<Floats> at_start = camera_from_world(now, mean);
  const Sweep coming = sweep_to_near_plane(now, last, at_end, at_start);
  const Sweep going = sweep_to_near_plane(now, first, at_start, at_end);
  return select(comes, coming, select(goes, going, s));
}

/// Appends the path of each hit to `paths`.
HWY_INLINE void write_paths(const Sweep& s, const Floats& log2_opacity, std::uint32_t hits,
                            SplatPath* paths) {
  const hn::ScalableTag<float> d;
  alignas(64) float quads[4 * Floats::count];
  hn::StoreInterleaved4(s.displacement.x.v, s.displacement.y.v, s.growth.v, log2_opacity.v, d,
                        quads);
  for (; hits != 0; hits &= hits - 1)
    std::memcpy(paths++, quads + std::countr_zero(hits) * 4, sizeof(SplatPath));
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif
