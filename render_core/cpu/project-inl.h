#if defined(CATGS_CPU_PROJECT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_PROJECT_INL_H
#undef CATGS_CPU_PROJECT_INL_H
#else
#define CATGS_CPU_PROJECT_INL_H
#endif

#include <algorithm>
#include <bit>
#include <cstring>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/lanes-inl.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"
#include "render_core/math/spherical_harmonics-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

/// What the projection of a task's Gaussians shares.
struct ProjectionContext {
  CameraModel<Doubles> precise;
  CameraModel<Floats> camera;
  Vec2<Floats> last_pixel;  // index of the last column and row
  Floats near_z;
};

inline ProjectionContext make_context(const Camera& camera) {
  const CameraModel<double> model = make_camera_model(camera);
  return {convert<Doubles>(model),
          convert<Floats>(model),
          {Floats(static_cast<float>(camera.size_px.x - 1)),
           Floats(static_cast<float>(camera.size_px.y - 1))},
          Floats(camera.near_z)};
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

/// Tiles [low, end) that a splat's box touches, as floats holding integers.
struct TileRange {
  Floats low, end;
  LaneMask<hn::ScalableTag<float>> hit;
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

/// Colour of the Gaussians at lanes `lane`… of a packet.
template <int degree>
HWY_INLINE Vec3<Floats> shade(const SceneStore& scene, std::size_t i, const Vec3<Floats>& mean,
                              const Vec3<Floats>& camera_position) {
  Floats basis[16];
  sh_basis(view_direction(camera_position, mean), degree, basis);
  const float* sh = scene.sh_of_packet(i / packet_size) + i % packet_size;
  Vec3<Floats> sum{Floats(0.0), Floats(0.0), Floats(0.0)};
  for (int k = 0; k < sh_coefficient_count(degree); ++k, sh += 3 * packet_size) {
    sum.x = mul_add(basis[k], Floats::load(sh), sum.x);
    sum.y = mul_add(basis[k], Floats::load(sh + packet_size), sum.y);
    sum.z = mul_add(basis[k], Floats::load(sh + 2 * packet_size), sum.z);
  }
  return {colour_from_sh_sum(sum.x), colour_from_sh_sum(sum.y), colour_from_sh_sum(sum.z)};
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

template <int degree, Pipeline pipeline>
std::uint32_t project_cluster_of(const ProjectTask& task) {
  const SceneStore& scene = *task.scene;
  const ProjectionContext context = make_context(*task.camera);
  const hn::ScalableTag<float> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const auto load = [&](SceneStore::Attribute a, std::size_t i)
                        HWY_ATTR { return Floats::load(scene.attribute(a) + i); };
  const std::size_t begin = task.cluster * cluster_size;
  const std::size_t end = std::min(scene.size(), begin + cluster_size);
  std::uint32_t visible = 0;
  for (std::size_t i = begin; i < end; i += Floats::count) {
    const Floats depth = depths(context, scene, i);
    const Floats log2_opacity = load(SceneStore::log2_opacity, i);
    const Floats reach = reach_of(log2_opacity);
    const auto in_front = (depth > context.near_z) & (reach >= Floats(0.0));
    if (none(in_front)) continue;

    const Vec3<Floats> mean{load(SceneStore::mean_x, i), load(SceneStore::mean_y, i),
                            load(SceneStore::mean_z, i)};
    const CovarianceFactor<Floats> factor{
        load(SceneStore::factor_xx, i), load(SceneStore::factor_yx, i),
        load(SceneStore::factor_yy, i), load(SceneStore::factor_zx, i),
        load(SceneStore::factor_zy, i), load(SceneStore::factor_zz, i)};
    const ProjectedGaussian<Floats> projected = project(context.camera, mean, factor, depth);
    const Vec2<Floats> half = half_extent(projected, max(reach, Floats(0.0)));
    TileRange columns, rows;
    if constexpr (pipeline == Pipeline::vanilla) {
      const Floats radius = three_sigma_radius(projected);
      columns = tiles_of_radius(projected.centre_px.x, radius, context.last_pixel.x);
      rows = tiles_of_radius(projected.centre_px.y, radius, context.last_pixel.y);
    } else {
      columns = tiles_of_box(projected.centre_px.x, half.x, context.last_pixel.x);
      rows = tiles_of_box(projected.centre_px.y, half.y, context.last_pixel.y);
    }
    std::uint32_t hits = bits(in_front & columns.hit & rows.hit);
    if (hits == 0) continue;

    const Whitening<Floats> w = whitening(projected);
    const Vec3<Floats> colour = shade<degree>(scene, i, mean, context.camera.position);
    const Floats index(hn::BitCast(d, hn::Load(du, scene.original_index() + i)));
    alignas(64) float splats[16 * Floats::count];
    interleave(
        {projected.centre_px.x, projected.centre_px.y, w.xx, w.xy, w.yy, log2_opacity, half.x,
         half.y, colour.x, colour.y, colour.z, depth, index, pack_pair(columns.low, rows.low),
         pack_pair(columns.end, rows.end), rightmost_y(w, max(reach, Floats(0.0)))},
        splats);
    for (; hits != 0; hits &= hits - 1) {
      const int lane = std::countr_zero(hits);
      std::memcpy(&task.splats[visible++], splats + lane * 16, sizeof(Splat));
    }
  }
  return visible;
}

template <Pipeline pipeline>
std::uint32_t project_cluster_of(const ProjectTask& task) {
  switch (task.scene->sh_degree()) {
    case 0:
      return project_cluster_of<0, pipeline>(task);
    case 1:
      return project_cluster_of<1, pipeline>(task);
    case 2:
      return project_cluster_of<2, pipeline>(task);
    default:
      return project_cluster_of<3, pipeline>(task);
  }
}

inline std::uint32_t project_cluster(const ProjectTask& task) {
  return task.pipeline == Pipeline::vanilla ? project_cluster_of<Pipeline::vanilla>(task)
                                            : project_cluster_of<Pipeline::exact>(task);
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif
