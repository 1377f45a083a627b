#if defined(CATGS_CPU_PROJECT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_PROJECT_INL_H
#undef CATGS_CPU_PROJECT_INL_H
#else
#define CATGS_CPU_PROJECT_INL_H
#endif

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "render_core/cpu/splats-inl.h"
#include "render_core/math/growth-inl.h"
#include "render_core/math/sweep-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

/// The region that the lists of a key frame cover.
struct ListContext {
  CameraModel<Floats> end_camera;
  ListGrowth<Floats> growth;
  Vec2<Floats> trail_shift_px;
  Vec2<Floats> first_px, last_px;  // of the grid; last_px relative to first_px
};

inline ListContext make_list_context(const FramePlan& plan) {
  const auto pair = [](const glm::ivec2& v) HWY_ATTR {
    return Vec2<Floats>{Floats(static_cast<float>(v.x)), Floats(static_cast<float>(v.y))};
  };
  Camera end = plan.window_end;
  end.near_z = plan.list_near_z;
  return {convert<Floats>(make_camera_model(end)), convert<Floats>(plan.growth),
          pair(plan.trail_shift_px), pair(plan.grid.first_px), pair(plan.grid.size_px - 1)};
}

/// The box of a splat, and the tiles that it may touch. `nearest_depth`: the least depth on its
/// way.
template <Pipeline pipeline>
HWY_INLINE SplatBox box_of(const ProjectionContext& context, const ListContext& lists,
                           const Sweep<Floats>& s, const Floats& reach,
                           const Floats& nearest_depth) {
  const Vec2<Floats> centre{s.shape.centre_px.x - lists.first_px.x,
                            s.shape.centre_px.y - lists.first_px.y};
  SplatBox box;
  box.growth_px = Floats(0.0);
  if constexpr (pipeline == Pipeline::vanilla) {
    const Floats radius = three_sigma_radius(s.shape);
    box.half_extent_x = half_extent(s.shape, reach).x;
    box.columns = tiles_of_radius(centre.x, radius, lists.last_px.x);
    box.rows = tiles_of_radius(centre.y, radius, lists.last_px.y);
  } else if constexpr (pipeline == Pipeline::catgs) {
    const Vec2<Floats> half = half_extent(s.outline, reach);
    const CameraModel<Floats>& camera = context.camera;
    const Vec2<Floats> slope{
        (s.shape.centre_px.x - camera.principal_point_px.x) / camera.focal_px.x,
        (s.shape.centre_px.y - camera.principal_point_px.y) / camera.focal_px.y};
    box.half_extent_x = half.x;
    box.growth_px = growth_px(lists.growth, slope, nearest_depth,
                              sqrt(mul_add(half.x, half.x, half.y * half.y)));
    const Floats step_x = Floats(0.5) * s.displacement.x, step_y = Floats(0.5) * s.displacement.y;
    box.columns =
        tiles_of_box(centre.x + step_x, half.x + box.growth_px + abs(step_x), lists.last_px.x);
    box.rows =
        tiles_of_box(centre.y + step_y, half.y + box.growth_px + abs(step_y), lists.last_px.y);
  } else {
    const Vec2<Floats> half = half_extent(s.shape, reach);
    box.half_extent_x = half.x;
    box.columns = tiles_of_box(centre.x, half.x, lists.last_px.x);
    box.rows = tiles_of_box(centre.y, half.y, lists.last_px.y);
  }
  return box;
}

/// Finds Gaussians from `i` on that are behind the near plane at both ends of the window, but that
/// a turn may bring into the picture. `reach`: of their ellipses.
HWY_INLINE FloatMask turning_in(const ProjectionContext& context, const ListContext& lists,
                                const SceneStore& scene, std::size_t i, const Floats& reach) {
  const Vec3<Floats> mean = load_mean(scene, i);
  const Vec3<Floats> now = camera_from_world(context.camera, mean);
  const Vec3<Floats> end = camera_from_world(lists.end_camera, mean);
  const auto behind = max(now.z, end.z) <= context.near_z;
  if (none(behind)) return behind;
  const Floats extent = extent_bound(load_factor(scene, i), reach);
  return behind & (may_turn_in(lists.growth, now, extent, context.near_z) |
                   may_turn_in(lists.growth, end, extent, context.near_z));
}

/// Lists the Gaussians in `mask` in all tiles.
HWY_INLINE void list_everywhere(const FloatMask& mask, const ListContext& lists, Sweep<Floats>& s,
                                SplatBox& box) {
  const Floats zero(0.0), one(1.0), everything(4.0 * max_image_side_px);
  const auto set = [&](Floats& field, const Floats& value)
                       HWY_ATTR { field = select(mask, value, field); };
  set(s.shape.centre_px.x, lists.first_px.x);
  set(s.shape.centre_px.y, lists.first_px.y);
  set(s.displacement.x, zero);
  set(s.displacement.y, zero);
  set(s.outline.xx, one);
  set(s.outline.xy, zero);
  set(s.outline.yy, one);
  set(box.half_extent_x, one);
  set(box.growth_px, everything);
  for (auto [range, last] :
       {std::pair(&box.columns, lists.last_px.x), std::pair(&box.rows, lists.last_px.y)}) {
    set(range->low, zero);
    set(range->end, floor(last * Floats(1.0 / tile_size_px)) + one);
    range->hit = range->hit | mask;
  }
}

/// Writes the path of each hit, one after the other. `half_extent_x`: of the outline.
HWY_INLINE void write_paths(const Sweep<Floats>& s, const Floats& log2_opacity, const Floats& reach,
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

template <Pipeline pipeline>
ClusterSummary project_cluster_of(const ProjectTask& task) {
  constexpr bool sweeps = pipeline == Pipeline::catgs;
  const SceneStore& scene = *task.scene;
  const FramePlan& plan = *task.plan;
  Camera camera = *task.camera;
  camera.near_z = plan.list_near_z;
  const ProjectionContext context = make_context(camera);
  const ListContext lists = make_list_context(plan);
  const Floats near_z(task.camera->near_z);  // of the current picture
  if constexpr (sweeps) task.members->fill(0);
  const std::size_t begin = task.cluster * cluster_size;
  const std::size_t end = std::min(scene.size(), begin + cluster_size);
  std::uint32_t visible = 0;
  Extremes extremes;
  for (std::size_t i = begin; i < end; i += Floats::count) {
    const Floats depth = depths(context, scene, i);
    const Floats log2_opacity = load(scene, SceneStore::log2_opacity, i);
    const Floats reach = max(reach_of(log2_opacity), Floats(0.0));
    const auto opaque = reach_of(log2_opacity) >= Floats(0.0);
    auto candidates = opaque & (depth > context.near_z);
    Floats nearest_depth = depth;
    if constexpr (sweeps) {
      const Floats depth_at_end = view_depth(lists.end_camera, load_mean(scene, i));
      candidates = opaque & (max(depth, depth_at_end) > context.near_z);
      nearest_depth = max(min(depth, depth_at_end), context.near_z);
    }
    FloatMask turns_in = depth < depth;  // none
    if constexpr (sweeps) {
      turns_in = opaque & turning_in(context, lists, scene, i, reach);
      candidates = candidates | turns_in;
    }
    if (none(candidates)) continue;

    const Vec3<Floats> mean = load_mean(scene, i);
    const CovarianceFactor<Floats> factor = load_factor(scene, i);
    Sweep<Floats> s;
    if constexpr (sweeps) {
      s = sweep(context.camera, lists.end_camera, mean, factor, depth);
      s.displacement.x = s.displacement.x + lists.trail_shift_px.x;
      s.displacement.y = s.displacement.y + lists.trail_shift_px.y;
    } else {
      s.shape = project(context.camera, mean, factor, depth);
    }
    SplatBox box = box_of<pipeline>(context, lists, s, reach, nearest_depth);
    if (!none(turns_in)) list_everywhere(turns_in, lists, s, box);
    const auto hit = candidates & box.columns.hit & box.rows.hit;
    const std::uint32_t hits = bits(hit);
    if (hits == 0) continue;

    SplatLook look;
    look.centre_px = s.shape.centre_px;
    look.w = whitening(s.shape);
    look.log2_opacity = log2_opacity;
    look.colour = colour_of(task.colours, scene, i, i - begin, mean, context.camera.position);
    look.depth = depth;
    look.original_index = load_index(scene, i);
    box.rightmost_y = rightmost_y(look.w, reach);
    const auto counted = hit & (depth > Floats(task.min_depth));
    extremes.add_depths(counted, depth);
    if constexpr (sweeps) {
      extremes.add_paths(counted, s.displacement);
      write_paths(s, log2_opacity, reach, box.half_extent_x, hits, task.paths + visible);
      (*task.members)[(i - begin) / 32] |= hits << ((i - begin) % 32);
      hide(look, depth > near_z, context.near_z);
    }
    write_splats(look, box, hits, task.splats + visible);
    visible += static_cast<std::uint32_t>(std::popcount(hits));
  }
  return extremes.summary(visible);
}

inline ClusterSummary project_cluster(const ProjectTask& task) {
  switch (task.pipeline) {
    case Pipeline::vanilla:
      return project_cluster_of<Pipeline::vanilla>(task);
    case Pipeline::exact:
      return project_cluster_of<Pipeline::exact>(task);
    default:
      return project_cluster_of<Pipeline::catgs>(task);
  }
}

inline ClusterSummary refresh_cluster(const RefreshTask& task) {
  const SceneStore& scene = *task.scene;
  const ProjectionContext context = make_context(*task.camera);
  const std::size_t begin = task.cluster * cluster_size;
  const std::size_t end = std::min(scene.size(), begin + cluster_size);
  constexpr std::uint32_t all_lanes = (1u << Floats::count) - 1u;
  std::uint32_t written = 0;
  Extremes extremes;
  for (std::size_t i = begin; i < end; i += Floats::count) {
    const std::uint32_t hits = (*task.members)[(i - begin) / 32] >> ((i - begin) % 32) & all_lanes;
    if (hits == 0) continue;
    SplatLook look;
    look.depth = depths(context, scene, i);
    const auto in_front = look.depth > context.near_z;
    const Vec3<Floats> mean = load_mean(scene, i);
    const ProjectedGaussian<Floats> shape =
        project(context.camera, mean, load_factor(scene, i), max(look.depth, context.near_z));
    look.centre_px = shape.centre_px;
    look.w = whitening(shape);
    look.log2_opacity = load(scene, SceneStore::log2_opacity, i);
    look.colour = colour_of(task.colours, scene, i, i - begin, mean, context.camera.position);
    look.original_index = load_index(scene, i);
    extremes.add_depths(mask_of_bits<hn::ScalableTag<float>>(hits) & in_front &
                            (look.depth > Floats(task.min_depth)),
                        look.depth);
    hide(look, in_front, context.near_z);
    write_splats(look, no_box(), hits, task.splats + written);
    for (std::uint32_t left = hits; left != 0; left &= left - 1, ++written)
      task.depths[written] = std::bit_cast<std::uint32_t>(task.splats[written].depth);
  }
  return extremes.summary(written);
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif
