#include "render_core/scene/edit/edit_scene.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"
#include "render_core/scene/edit/merge_gaussians.h"
#include "render_core/scene/edit/remove_floaters.h"
#include "render_core/scene/keep_if.h"
#include "render_core/scene/prune.h"
#include "render_core/scene/scene_origin.h"

namespace catgs {
namespace {

/// NaN is out of range, too.
bool in_range(const glm::vec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}) <= max_coordinate &&
         !glm::any(glm::isnan(v));
}

[[noreturn]] void fail_out_of_range(std::string_view what) {
  throw InputError("placement", "",
                   fmt::format("{} would lie or reach beyond {} units", what, max_coordinate),
                   "scale less, or move less far");
}

glm::vec3 place_in_range(const AffineMap& map, const glm::vec3& point) {
  const glm::vec3 to(map(glm::dvec3(point)));
  if (!in_range(to)) fail_out_of_range("a place of the scene's hints");
  return to;
}

void place_cloud(GaussianCloud& cloud, const Placement& placement, ThreadPool& pool) {
  constexpr std::size_t block = 4096;
  const CloudTransform transform(placement.map());
  std::atomic<bool> fits = true;
  pool.parallel_for((cloud.size() + block - 1) / block, [&](std::size_t part) {
    for (std::size_t i = part * block; i < std::min(cloud.size(), (part + 1) * block); ++i) {
      transform.apply(cloud, i);
      cloud.scale[i] = glm::max(cloud.scale[i], glm::vec3(1e-10f));  // as sanitize() has it
      if (!in_range(cloud.mean[i]) || !in_range(cloud.scale[i])) fits = false;
    }
  });
  if (!fits) fail_out_of_range("a Gaussian");
}

void crop(GaussianCloud& cloud, const CropBox& box) {
  keep_if(cloud, [&](std::size_t i) {
    const glm::dvec3 mean(cloud.mean[i]);
    return glm::all(glm::greaterThanEqual(mean, box.min)) &&
           glm::all(glm::lessThanEqual(mean, box.max));
  });
}

std::size_t left_by_merging(const SceneEdit& edit, std::size_t count) {
  const double share = std::ceil(edit.merge_fraction * static_cast<double>(count));
  const std::size_t wanted = std::min(count, static_cast<std::size_t>(share));
  return edit.merge_to > 0 ? std::min(wanted, edit.merge_to) : wanted;
}

}  // namespace

bool Placement::moves() const {
  return scale != 1.0 || rotation != glm::dquat(1.0, 0.0, 0.0, 0.0) || offset != glm::dvec3(0.0);
}

AffineMap Placement::map() const { return {scale * glm::mat3_cast(rotation), offset}; }

EditAboutOrigin about_origin(const SceneEdit& edit, const glm::dvec3& origin) {
  EditAboutOrigin about{edit, origin};
  if (edit.placement.moves()) {
    const glm::dvec3 moved = edit.placement.map()(origin);
    if (!in_range(glm::vec3(moved))) fail_out_of_range("the origin of the scene");
    about.origin = origin_near(moved);
    about.edit.placement.offset = moved - about.origin;
  }
  if (about.edit.crop) {
    about.edit.crop->min -= about.origin;
    about.edit.crop->max -= about.origin;
  }
  return about;
}

EditCounts edit_cloud(GaussianCloud& cloud, const SceneEdit& edit, ThreadPool& pool,
                      const LoadContext& context) {
  EditCounts counts;
  std::size_t before = cloud.size();
  if (edit.placement.moves()) place_cloud(cloud, edit.placement, pool);
  if (edit.crop) crop(cloud, *edit.crop);
  counts.cropped = before - cloud.size();
  if (edit.remove_floaters) counts.floaters = remove_floaters(cloud, pool);
  if (cloud.empty()) return counts;
  before = cloud.size();
  keep_most_important(cloud, edit.keep_fraction);
  counts.pruned = before - cloud.size();
  before = cloud.size();
  merge_gaussians(cloud, left_by_merging(edit, before), pool, context);
  counts.merged = before - cloud.size();
  return counts;
}

SceneHints placed(const SceneHints& hints, const Placement& placement) {
  const AffineMap map = placement.map();
  const glm::quat turn(placement.rotation);
  const auto scale = static_cast<float>(placement.scale);
  SceneHints to = hints;
  to.up = glm::vec3(placement.rotation * glm::dvec3(hints.up));
  to.start_pose = {place_in_range(map, hints.start_pose.position),
                   glm::normalize(turn * hints.start_pose.orientation)};
  to.near_z = scale * hints.near_z;
  to.scale = scale * hints.scale;
  to.about.metres_per_unit = hints.about.metres_per_unit / scale;
  if (hints.about.metres_per_unit > 0.0f && !is_metres_per_unit(to.about.metres_per_unit))
    fail_out_of_range("metres_per_unit");
  to.focus = place_in_range(map, hints.focus);
  to.limits = {glm::vec3(std::numeric_limits<float>::max()),
               glm::vec3(std::numeric_limits<float>::lowest())};
  for (int corner = 0; corner < 8; ++corner) {
    const glm::bvec3 high(corner & 1, corner & 2, corner & 4);
    const glm::vec3 at = place_in_range(map, glm::mix(hints.limits.min, hints.limits.max, high));
    to.limits = {glm::min(to.limits.min, at), glm::max(to.limits.max, at)};
  }
  if (!(to.near_z > 0.0f && to.near_z <= max_coordinate)) fail_out_of_range("the near plane");
  return to;
}

}  // namespace catgs
