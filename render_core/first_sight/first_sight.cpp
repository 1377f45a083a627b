#include "render_core/first_sight/first_sight.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/first_sight/content.h"
#include "render_core/first_sight/standpoints.h"
#include "render_core/first_sight/view_judge.h"
#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/scene/analysis/voxel_grid.h"

namespace catgs {
namespace {

using namespace first_sight;

struct Sight {
  Pose pose;
  glm::vec3 focus{0.0f};
  float scale = 0.0f;  // SceneHints::scale
  Judgement seen;
  float score = 0.0f;
};

/// The box with room around it for what the bounds of most of the scene leave out.
Bounds with_surroundings(const Bounds& core) {
  const glm::vec3 extent = core.max - core.min;
  const float longest = std::max({extent.x, extent.y, extent.z});
  const glm::vec3 margin = glm::max(0.75f * extent, glm::vec3(0.25f * longest + 1e-3f));
  return {core.min - margin, core.max + margin};
}

Sight best_inside(const std::vector<InnerView>& views, ViewJudge& judge) {
  constexpr float max_eye_heights = 4.0f;  // of the scale: halls are not crossed in a second
  Sight best;
  for (const InnerView& view : views) {
    const auto score_of = [&](const Judgement& seen) {
      return view.openness * seen.coverage * (1.0f - seen.veil) * seen.spread;
    };
    const auto is_best = [&](const Judgement& seen) { return score_of(seen) > best.score; };
    const Judgement seen = judge.judge(view.pose, 0.15f * view.ahead, is_best);
    if (!is_best(seen)) continue;
    const glm::vec3 forward = view.pose.orientation * glm::vec3(0, 0, 1);
    const float scale = std::min(view.ahead, max_eye_heights * view.height);
    best = {view.pose, view.pose.position + view.ahead * forward, scale, seen, score_of(seen)};
  }
  return best;
}

/// The usual direction of the first look: captures begin near the identity pose, which looks along
/// +z. A unit vector at a right angle to `up`, towards the camera.
glm::vec3 usual_front(const glm::vec3& up) {
  const glm::vec3 front(0, 0, -1);
  return glm::normalize(front - glm::dot(front, up) * up);
}

/// The best of the views that have the whole content in the picture, from `closer` times the
/// distance that this takes.
Sight best_around(const Content& content, float closer, const glm::vec3& up, ViewJudge& judge) {
  constexpr int azimuths = 16;
  constexpr float front_preference = 0.1f;  // decides for objects that look alike from all sides
  const glm::vec3 front = usual_front(up), side = glm::cross(up, front);
  const float one_end = glm::dot(content.bounds.min, up),
              other_end = glm::dot(content.bounds.max, up);
  const float low = glm::mix(std::min(one_end, other_end), std::max(one_end, other_end), 0.25f);
  Sight best;
  for (const float elevation : {0.0f, 0.2f, 0.45f})
    for (int a = 0; a < azimuths; ++a) {
      const float azimuth = 6.2831853f * static_cast<float>(a) / azimuths;
      const glm::vec3 level = std::cos(azimuth) * front + std::sin(azimuth) * side;
      const glm::vec3 forward = -std::cos(elevation) * level - std::sin(elevation) * up;
      const OuterView whole = fit(content, forward, up);
      if (glm::dot(whole.pose.position, up) < low) continue;  // the ground would be in between
      const float forwards = (1.0f - closer) * whole.distance, ahead = closer * whole.distance;
      const Pose pose{whole.pose.position + forwards * forward, whole.pose.orientation};
      const auto score_of = [&](const Judgement& seen) {
        // Detail for its size: what is broad is not the front for that alone.
        const float crowded = 1e-6f + seen.detail * seen.detail / (seen.coverage + 0.001f);
        return crowded * (1.0f + seen.symmetry) * (1.0f - seen.veil) *
               (1.0f + front_preference * std::cos(azimuth));
      };
      const auto is_best = [&](const Judgement& seen) { return score_of(seen) > best.score; };
      const Judgement seen =
          judge.judge(pose, std::max(0.9f * whole.nearest - forwards, 0.1f * ahead), is_best);
      if (is_best(seen))
        best = {pose, pose.position + ahead * forward, ahead, seen, score_of(seen)};
    }
  return best;
}

/// As far away as nothing hides the content: not behind the sky of an outdoor scene, or its trees.
Sight best_unveiled(const Content& content, const glm::vec3& up, ViewJudge& judge) {
  constexpr float clear = 0.2f;
  Sight best;
  for (const float closer : {1.0f, 0.7f, 0.5f, 0.35f}) {
    const Sight sight = best_around(content, closer, up, judge);
    if (sight.score > best.score) best = sight;
    if (sight.score > 0.0f && sight.seen.veil < clear) break;
  }
  return best;
}

/// A scene is seen from inside where much of its box is surrounded free space, or where the best
/// view from inside leaves no gap.
Sight best_sight(const Inside& inside, const Content& content, const glm::vec3& up,
                 ViewJudge& judge) {
  constexpr float enough_space = 0.1f, no_gap = 0.95f;
  const Sight within = best_inside(inside.views, judge);
  if (inside.share > enough_space || within.seen.coverage > no_gap) return within;
  return best_unveiled(content, up, judge);
}

/// The quarter turns that take the axis nearest to `up` to -y, where most captures have it: z by
/// one about x, because scenes with z up are by habit seen along +y. Half a turn about x more takes
/// the opposite axes there. So a scene and its half turn have the same view, whatever the ties.
glm::quat to_usual_axes(const glm::vec3& up) {
  const glm::vec3 size = glm::abs(up);
  const glm::quat half_about_x(0, 1, 0, 0), half_about_y(0, 0, 1, 0), none(1, 0, 0, 0);
  const float quarter = std::sqrt(0.5f);
  if (size.y >= std::max(size.x, size.z)) return up.y > 0.0f ? half_about_x : none;
  if (size.z >= size.x)
    return glm::quat(quarter, quarter, 0, 0) * (up.z > 0.0f ? none : half_about_x);
  return glm::quat(quarter, 0, 0, -quarter) * (up.x > 0.0f ? none : half_about_y);
}

SceneHints estimate_upright(const GaussianCloud& cloud, const glm::vec3& up,
                            std::shared_ptr<ThreadPool> pool, float stands_for) {
  const Bounds core = robust_bounds(cloud).value_or(Bounds{glm::vec3(-1), glm::vec3(1)});
  const VoxelGrid grid(cloud, with_surroundings(core), stands_for);
  const Inside inside = look_inside(grid, core, up, *pool);
  const Content content = find_content(grid, core);
  ViewJudge judge(cloud, stands_for, core, std::move(pool));
  const Sight sight = best_sight(inside, content, up, judge);

  const auto& [min, max] = content.bounds;
  // Limits on both sides of a lone Gaussian differ, however far away it is.
  const float radius = std::max({0.5f * glm::distance(min, max), 1e-3f, 1e-6f * glm::length(max)});
  const glm::vec3& start = sight.pose.position;
  SceneHints hints;
  hints.up = up;
  hints.source = "estimated";
  hints.start_pose = sight.pose;
  hints.focus = sight.focus;
  hints.scale = std::max(sight.scale, 1e-3f * radius);
  hints.near_z = std::min(0.2f, 0.02f * radius);
  hints.limits = {glm::min(min, start) - radius, glm::max(max, start) + radius};
  return hints;
}

}  // namespace

SceneHints estimate_hints(const GaussianCloud& cloud, const glm::vec3& up,
                          std::shared_ptr<ThreadPool> pool, float stands_for) {
  const glm::quat turn = to_usual_axes(up), back = glm::conjugate(turn);
  if (turn.w == 1.0f) return estimate_upright(cloud, up, std::move(pool), stands_for);
  glm::mat3 axes = glm::mat3_cast(turn);
  for (int k = 0; k < 3; ++k) axes[k] = glm::round(axes[k]);
  const glm::mat3 axes_back = glm::transpose(axes);
  GaussianCloud turned = cloud;
  for (glm::vec3& mean : turned.mean) mean = axes * mean;
  for (glm::quat& rotation : turned.rotation) rotation = turn * rotation;
  SceneHints hints = estimate_upright(turned, axes * up, std::move(pool), stands_for);
  hints.up = up;
  hints.start_pose = {axes_back * hints.start_pose.position, back * hints.start_pose.orientation};
  hints.focus = axes_back * hints.focus;
  const glm::vec3 one = axes_back * hints.limits.min, other = axes_back * hints.limits.max;
  hints.limits = {glm::min(one, other), glm::max(one, other)};
  return hints;
}

}  // namespace catgs
