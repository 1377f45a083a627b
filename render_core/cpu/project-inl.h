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

#include "render_core/cpu/limits-inl.h"
#include "render_core/cpu/splats-inl.h"
#include "render_core/math/sweep-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

/// The box of a splat, and the tiles that it may touch. `last_px`: of the picture.
template <Pipeline pipeline>
HWY_INLINE SplatBox box_of(const Sweep<Floats>& s, const Floats& reach,
                           const Vec2<Floats>& last_px) {
  const Vec2<Floats>& centre = s.shape.centre_px;
  SplatBox box;
  if constexpr (pipeline == Pipeline::vanilla) {
    const Floats radius = three_sigma_radius(s.shape);
    box.half_extent_x = half_extent(s.shape, reach).x;
    box.columns = tiles_of_radius(centre.x, radius, last_px.x);
    box.rows = tiles_of_radius(centre.y, radius, last_px.y);
  } else if constexpr (pipeline == Pipeline::paper) {
    const Vec2<Floats> half = half_extent(s.outline, reach);
    const Floats step_x = Floats(0.5) * s.displacement.x, step_y = Floats(0.5) * s.displacement.y;
    box.half_extent_x = half.x;
    box.columns = tiles_of_box(centre.x + step_x, half.x + abs(step_x), last_px.x);
    box.rows = tiles_of_box(centre.y + step_y, half.y + abs(step_y), last_px.y);
  } else {
    const Vec2<Floats> half = half_extent(s.shape, reach);
    box.half_extent_x = half.x;
    box.columns = tiles_of_box(centre.x, half.x, last_px.x);
    box.rows = tiles_of_box(centre.y, half.y, last_px.y);
  }
  return box;
}

/// The opacity with which splats are drawn.
HWY_INLINE Floats look_of(const SceneStore& scene, const Floats& log2_opacity,
                          const ProjectedGaussian<Floats>& shape) {
  return scene.antialiased() ? antialiased_log2_opacity(log2_opacity, shape) : log2_opacity;
}

/// Whether splats are behind the limits of all parts that their boxes meet.
HWY_INLINE FloatMask is_hidden(const DepthLimits& limits, const ProjectedGaussian<Floats>& shape,
                               const Floats& reach, const Floats& depth,
                               const Vec2<Floats>& last_px) {
  const Vec2<Floats> half = half_extent(shape, reach);
  const Floats zero(0.0);
  const Vec2<Floats>& centre = shape.centre_px;
  return depth > deepest_limit(limits, clamp(centre.x - half.x, zero, last_px.x),
                               clamp(centre.y - half.y, zero, last_px.y),
                               clamp(centre.x + half.x, zero, last_px.x),
                               clamp(centre.y + half.y, zero, last_px.y));
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

/// An eye of a task, and the splats that are written for it.
struct TaskEye {
  const CameraModel<Floats>* camera;
  DepthLimits limits;
  ClusterColours colours;
  Splat* splats;
  std::uint32_t visible;
};

/// The eyes of a task: `count` of them.
struct TaskEyes {
  CameraModel<Floats> second_camera;
  TaskEye eyes[2];
  int count;
};

/// `camera`: of the first eye.
inline void set_eyes(const ProjectTask& task, const CameraModel<Floats>& camera, TaskEyes& out) {
  const SecondEye& second = task.second;
  out.eyes[0] = {&camera, task.limits, task.colours, task.splats, 0};
  out.count = second.camera == nullptr ? 1 : 2;
  if (out.count == 1) return;
  out.second_camera = convert<Floats>(make_camera_model(*second.camera));
  out.eyes[1] = {&out.second_camera, second.limits, second.colours, second.splats, 0};
}

/// Some Gaussians before they are projected.
struct UnprojectedGaussians {
  std::size_t first;
  Vec3<Floats> mean;
  CovarianceFactor<Floats> factor;
  Floats depth, log2_opacity;
  FloatMask candidates;  // those that may be drawn
};

/// Projects Gaussians for an eye. Fills in all of `look` but the colour. Returns which are visible,
/// a bit each; where none is, what is filled in says nothing. `end_camera`: of a window.
template <Pipeline pipeline>
HWY_INLINE std::uint32_t project_for(const SceneStore& scene, const TaskEye& eye,
                                     const CameraModel<Floats>& end_camera,
                                     const Vec2<Floats>& last_px, const UnprojectedGaussians& g,
                                     Sweep<Floats>& s, SplatLook& look, SplatBox& box) {
  constexpr bool sweeps = pipeline == Pipeline::paper;
  if constexpr (sweeps) {
    s = sweep(*eye.camera, end_camera, g.mean, g.factor, g.depth);
  } else {
    s.shape = project(*eye.camera, g.mean, g.factor, g.depth);
  }
  look.log2_opacity = look_of(scene, g.log2_opacity, s.shape);
  // On a path the footprint changes; that with all of the opacity holds it.
  const Floats all_reach = reach_of(sweeps ? g.log2_opacity : look.log2_opacity);
  const Floats reach = max(all_reach, Floats(0.0));
  box = box_of<pipeline>(s, reach, last_px);
  const auto hit = g.candidates & (all_reach >= Floats(0.0)) & box.columns.hit & box.rows.hit;
  std::uint32_t hits = bits(hit);
  if (hits != 0 && eye.limits)
    hits &= ~bits(is_hidden(eye.limits, s.shape, reach, g.depth, last_px));
  if (hits == 0) return 0;
  look.centre_px = s.shape.centre_px;
  look.w = whitening(s.shape);
  look.depth = g.depth;
  look.scene_order = load_index(scene, g.first);
  box.rightmost_y = rightmost_y(look.w, reach);
  return hits;
}

template <Pipeline pipeline>
ClusterSummary project_cluster_of(const ProjectTask& task) {
  constexpr bool sweeps = pipeline == Pipeline::paper;
  const SceneStore& scene = *task.scene;
  const ProjectionContext context = make_context(*task.camera);
  const Vec2<Floats> last_px{Floats(static_cast<float>(task.camera->size_px.x - 1)),
                             Floats(static_cast<float>(task.camera->size_px.y - 1))};
  TaskEyes eyes;
  set_eyes(task, context.camera, eyes);
  CameraModel<Floats> end_camera;
  if constexpr (sweeps) {
    end_camera = convert<Floats>(make_camera_model(*task.window_end));
    task.members->fill(0);
  }
  const std::size_t begin = task.cluster * cluster_size;
  const std::size_t end = std::min(scene.size(), begin + cluster_size);
  Extremes extremes;
  for (std::size_t i = begin; i < end; i += Floats::count) {
    UnprojectedGaussians g;
    g.first = i;
    g.depth = depths(context, scene, i);
    g.log2_opacity = load_log2_opacity(scene, i, task.share);
    g.mean = load_mean(scene, i);
    Floats deepest = g.depth;
    if constexpr (sweeps) deepest = max(g.depth, view_depth(end_camera, g.mean));
    g.candidates = (reach_of(g.log2_opacity) >= Floats(0.0)) & (deepest > context.near_z) &
                   is_kept(context.camera, g.mean);
    if (none(g.candidates)) continue;
    g.factor = load_factor(scene, i);

    std::uint32_t hits_of_any = 0;
    Sweep<Floats> s;
    SplatLook look;
    for (int e = 0; e < eyes.count; ++e) {
      TaskEye& eye = eyes.eyes[e];
      SplatBox box;
      const std::uint32_t hits =
          project_for<pipeline>(scene, eye, end_camera, last_px, g, s, look, box);
      if (hits == 0) continue;
      look.colour = colour_of(eye.colours, scene, i, i - begin, g.mean, eye.camera->eye);
      hits_of_any |= hits;
      if constexpr (sweeps) {
        const Floats reach = max(reach_of(g.log2_opacity), Floats(0.0));
        write_paths(s, g.log2_opacity, reach, box.half_extent_x, hits, task.paths + eye.visible);
        (*task.members)[(i - begin) / 32] |= hits << ((i - begin) % 32);
        hide(look, g.depth > context.near_z, context.near_z);
      }
      write_splats(look, box, hits, eye.splats + eye.visible);
      eye.visible += static_cast<std::uint32_t>(std::popcount(hits));
    }
    if (hits_of_any == 0) continue;
    const auto counted =
        mask_of_bits<hn::ScalableTag<float>>(hits_of_any) & (g.depth > Floats(task.min_depth));
    extremes.add_depths(counted, g.depth);
    if constexpr (sweeps) extremes.add_paths(counted, s.displacement);
  }
  ClusterSummary summary = extremes.summary(eyes.eyes[0].visible);
  if (eyes.count > 1) summary.visible_to_second = eyes.eyes[1].visible;
  return summary;
}

inline ClusterSummary project_cluster(const ProjectTask& task) {
  switch (task.pipeline) {
    case Pipeline::vanilla:
      return project_cluster_of<Pipeline::vanilla>(task);
    case Pipeline::paper:
      return project_cluster_of<Pipeline::paper>(task);
    default:
      return project_cluster_of<Pipeline::exact>(task);
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
    look.log2_opacity = look_of(scene, load_log2_opacity(scene, i, task.share), shape);
    look.colour = colour_of(task.colours, scene, i, i - begin, mean, context.camera.eye);
    look.scene_order = load_index(scene, i);
    extremes.add_depths(mask_of_bits<hn::ScalableTag<float>>(hits) & in_front &
                            (look.depth > Floats(task.min_depth)),
                        look.depth);
    hide(look, in_front, context.near_z);
    write_splats(look, no_box(), hits, task.splats + written);
    written += static_cast<std::uint32_t>(std::popcount(hits));
  }
  return extremes.summary(written);
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif
