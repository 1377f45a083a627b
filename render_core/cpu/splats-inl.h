#if defined(CATGS_CPU_SPLATS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_SPLATS_INL_H
#undef CATGS_CPU_SPLATS_INL_H
#else
#define CATGS_CPU_SPLATS_INL_H
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/lanes-inl.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/fade-inl.h"
#include "render_core/math/projection-inl.h"
#include "render_core/math/spherical_harmonics-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

// Shared by projecting and refreshing: loading Gaussians, shading them, writing splats.

/// Constants of a task's projections.
struct ProjectionContext {
  CameraModel<Doubles> precise;
  CameraModel<Floats> camera;
  Floats near_z;
};

inline ProjectionContext make_context(const Camera& camera) {
  const CameraModel<double> model = make_camera_model(camera);
  return {convert<Doubles>(model), convert<Floats>(model), Floats(camera.near_z)};
}

/// Depths of Floats::count Gaussians from `i` on.
HWY_INLINE Floats depths(const ProjectionContext& context, const SceneStore& scene, std::size_t i) {
  using D = hn::ScalableTag<double>;
  const D d;
  const hn::Rebind<float, D> half;
  alignas(64) float depth[Floats::count];
  const auto promote = [&](SceneStore::Attribute a, std::size_t at) HWY_ATTR {
    return Doubles(hn::PromoteTo(d, hn::Load(half, scene.attribute(a) + at)));
  };
  for (std::size_t part = 0; part < Floats::count; part += Doubles::count) {
    const Vec3<Doubles> mean{promote(SceneStore::mean_x, i + part),
                             promote(SceneStore::mean_y, i + part),
                             promote(SceneStore::mean_z, i + part)};
    hn::Store(hn::DemoteTo(half, view_depth(context.precise, mean).v), half, depth + part);
  }
  return Floats::load(depth);
}

HWY_INLINE Floats load(const SceneStore& scene, SceneStore::Attribute a, std::size_t i) {
  return Floats::load(scene.attribute(a) + i);
}

HWY_INLINE Vec3<Floats> load_mean(const SceneStore& scene, std::size_t i) {
  return {load(scene, SceneStore::mean_x, i), load(scene, SceneStore::mean_y, i),
          load(scene, SceneStore::mean_z, i)};
}

HWY_INLINE CovarianceFactor<Floats> load_factor(const SceneStore& scene, std::size_t i) {
  return {load(scene, SceneStore::factor_xx, i), load(scene, SceneStore::factor_yx, i),
          load(scene, SceneStore::factor_yy, i), load(scene, SceneStore::factor_zx, i),
          load(scene, SceneStore::factor_zy, i), load(scene, SceneStore::factor_zz, i)};
}

/// `share`: the part of the Gaussians that is drawn.
HWY_INLINE Floats load_log2_opacity(const SceneStore& scene, std::size_t i, float share) {
  const Floats all = load(scene, SceneStore::log2_opacity, i);
  return share < 1.0f ? faded_log2_opacity(all, Floats(share)) : all;
}

/// Original indices as fields of a Splat.
HWY_INLINE Floats load_index(const SceneStore& scene, std::size_t i) {
  const hn::ScalableTag<float> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  return Floats(hn::BitCast(d, hn::Load(du, scene.scene_order() + i)));
}

/// Colour of the Gaussians from `i` on, which share a packet.
template <int degree>
HWY_INLINE Vec3<Floats> shade_of_degree(const SceneStore& scene, std::size_t i,
                                        const Vec3<Floats>& mean, const Vec3<Floats>& eye) {
  Floats basis[16];
  sh_basis(view_direction(eye, mean), degree, basis);
  const float* sh = scene.sh_of_packet(i / packet_size) + i % packet_size;
  Vec3<Floats> sum{Floats(0.0), Floats(0.0), Floats(0.0)};
  for (int k = 0; k < sh_coefficient_count(degree); ++k, sh += 3 * packet_size) {
    sum.x = mul_add(basis[k], Floats::load(sh), sum.x);
    sum.y = mul_add(basis[k], Floats::load(sh + packet_size), sum.y);
    sum.z = mul_add(basis[k], Floats::load(sh + 2 * packet_size), sum.z);
  }
  return {colour_from_sh_sum(sum.x), colour_from_sh_sum(sum.y), colour_from_sh_sum(sum.z)};
}

inline Vec3<Floats> shade(const SceneStore& scene, std::size_t i, const Vec3<Floats>& mean,
                          const Vec3<Floats>& eye) {
  switch (scene.sh_degree()) {
    case 0:
      return shade_of_degree<0>(scene, i, mean, eye);
    case 1:
      return shade_of_degree<1>(scene, i, mean, eye);
    case 2:
      return shade_of_degree<2>(scene, i, mean, eye);
    default:
      return shade_of_degree<3>(scene, i, mean, eye);
  }
}

/// Colour of the Gaussians from `i` on, which begin at place `at` of their cluster. Cached colours
/// are used; others are shaded, and cached if there is room.
HWY_INLINE Vec3<Floats> colour_of(const ClusterColours& colours, const SceneStore& scene,
                                  std::size_t i, std::size_t at, const Vec3<Floats>& mean,
                                  const Vec3<Floats>& eye) {
  if (colours.rgb == nullptr) return shade(scene, i, mean, eye);
  constexpr std::uint32_t all_lanes = (1u << Floats::count) - 1u;
  std::uint32_t& shaded = (*colours.shaded)[at / 32];
  float* const rgb = colours.rgb + at;
  if ((shaded >> (at % 32) & 1u) == 0) {
    const Vec3<Floats> colour = shade(scene, i, mean, eye);
    colour.x.store(rgb);
    colour.y.store(rgb + cluster_size);
    colour.z.store(rgb + 2 * cluster_size);
    shaded |= all_lanes << (at % 32);
    return colour;
  }
  return {Floats::load(rgb), Floats::load(rgb + cluster_size),
          Floats::load(rgb + 2 * cluster_size)};
}

/// Tiles [low, end) that a splat's box touches, as floats holding integers.
struct TileRange {
  Floats low, end;
  FloatMask hit;
};

/// Tiles with a pixel centre in centre +- half; `last_pixel` is the last column or row.
HWY_INLINE TileRange tiles_of_box(Floats centre, Floats half, Floats last_pixel) {
  const Floats reach = mul_add(half, Floats(1.0 + 1e-5), Floats(listing_slack_px));
  const Floats low = max(ceil(centre - reach - Floats(0.5)), Floats(0.0));
  const Floats high = min(floor(centre + reach - Floats(0.5)), last_pixel);
  const Floats per_px = Floats(1.0 / tile_size_px);
  return {floor(low * per_px), floor(high * per_px) + Floats(1.0), low <= high};
}

/// The original's tiles: those that a box of whole pixels around the centre overlaps.
HWY_INLINE TileRange tiles_of_radius(Floats centre, Floats radius, Floats last_pixel) {
  const Floats side = Floats(static_cast<float>(tile_size_px));
  const Floats per_px = Floats(1.0 / tile_size_px);
  const Floats tiles = floor(last_pixel * per_px) + Floats(1.0);
  const Floats at = centre - Floats(0.5);
  const Floats low = clamp(floor((at - radius) * per_px), Floats(0.0), tiles);
  const Floats end = clamp(floor((at + radius + side - Floats(1.0)) * per_px), Floats(0.0), tiles);
  return {low, end, low < end};
}

/// Two small integers held in floats as one 32-bit field.
HWY_INLINE Floats pack_pair(Floats low, Floats high) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const auto bits = hn::Or(hn::ConvertTo(di, low.v), hn::ShiftLeft<16>(hn::ConvertTo(di, high.v)));
  return Floats(hn::BitCast(d, bits));
}

/// Writes the Floats::count splats of a packet part to `out`, lane after lane.
HWY_INLINE void interleave(const Floats (&fields)[16], float* out) {
  const hn::ScalableTag<float> d;
  alignas(64) float quads[4][4 * Floats::count];
  for (int q = 0; q < 4; ++q)
    hn::StoreInterleaved4(fields[4 * q].v, fields[4 * q + 1].v, fields[4 * q + 2].v,
                          fields[4 * q + 3].v, d, quads[q]);
  for (std::size_t lane = 0; lane < Floats::count; ++lane)
    for (int q = 0; q < 4; ++q) std::memcpy(out + lane * 16 + q * 4, quads[q] + lane * 4, 16);
}

/// The fields of a splat that blending needs.
struct SplatLook {
  Vec2<Floats> centre_px;
  Whitening<Floats> w;
  Floats log2_opacity;
  Vec3<Floats> colour;
  Floats depth, scene_order;
};

/// The fields that listing needs in addition.
struct SplatBox {
  Floats half_extent_x;
  TileRange columns, rows;
  Floats rightmost_y;
};

/// The box of splats that are listed already.
HWY_INLINE SplatBox no_box() {
  const Floats zero(0.0);
  const FloatMask nowhere = zero < zero;
  return {zero, {zero, zero, nowhere}, {zero, zero, nowhere}, zero};
}

/// Makes splats that are not in front of the near plane draw nothing, at a depth that can be
/// sorted.
HWY_INLINE void hide(SplatLook& look, const FloatMask& in_front, const Floats& near_z) {
  look.log2_opacity = select(in_front, look.log2_opacity, Floats(hidden_log2_opacity));
  look.depth = max(look.depth, near_z);
}

/// Writes the splats of the lanes in `hits`, one after the other.
HWY_INLINE void write_splats(const SplatLook& s, const SplatBox& box, std::uint32_t hits,
                             Splat* out) {
  alignas(64) float splats[16 * Floats::count];
  interleave({s.centre_px.x, s.centre_px.y, s.w.xx, s.w.xy, s.w.yy, s.log2_opacity,
              box.half_extent_x, Floats(0.0), s.colour.x, s.colour.y, s.colour.z, s.depth,
              s.scene_order, pack_pair(box.columns.low, box.rows.low),
              pack_pair(box.columns.end, box.rows.end), box.rightmost_y},
             splats);
  for (; hits != 0; hits &= hits - 1)
    std::memcpy(out++, splats + std::countr_zero(hits) * 16, sizeof(Splat));
}

/// Collects a ClusterSummary.
struct Extremes {
  Floats nearest_depth, inverse_depths, longest_square;
  std::uint32_t counted = 0;

  // Written out, because the compiler's own constructor would not be compiled for this instruction
  // set.
  HWY_INLINE Extremes()
      : nearest_depth(std::numeric_limits<float>::infinity()),
        inverse_depths(0.0f),
        longest_square(0.0f) {}

  HWY_INLINE void add_depths(const FloatMask& deep, const Floats& depth) {
    nearest_depth = select(deep, min(nearest_depth, depth), nearest_depth);
    inverse_depths = select(deep, inverse_depths + Floats(1.0) / depth, inverse_depths);
    counted += static_cast<std::uint32_t>(std::popcount(bits(deep)));
  }
  HWY_INLINE void add_paths(const FloatMask& deep, const Vec2<Floats>& path) {
    const Floats square = mul_add(path.x, path.x, path.y * path.y);
    longest_square = select(deep, max(longest_square, square), longest_square);
  }
  HWY_INLINE ClusterSummary summary(std::uint32_t visible) const {
    const hn::ScalableTag<float> d;
    return {visible, counted, hn::GetLane(hn::MinOfLanes(d, nearest_depth.v)),
            hn::GetLane(hn::SumOfLanes(d, inverse_depths.v)),
            std::sqrt(hn::GetLane(hn::MaxOfLanes(d, longest_square.v)))};
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif
