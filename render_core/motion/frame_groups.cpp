#include "render_core/motion/frame_groups.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "render_core/base/error.h"

namespace catgs {
namespace {

constexpr int grid_steps = 4;  // per axis of the image, its edges included

/// Image and near plane are the same, so the cached lists still apply.
bool same_lens(const Camera& a, const Camera& b) {
  return a.size_px == b.size_px && a.focal_px == b.focal_px &&
         a.principal_point_px == b.principal_point_px && a.near_z == b.near_z;
}

Camera at_pose(const Camera& camera, const Pose& world_from_camera) {
  Camera moved = camera;
  moved.world_from_camera = world_from_camera;
  return moved;
}

glm::dquat unit(const glm::quat& q) { return glm::normalize(glm::dquat(q)); }

/// The image of one camera as it appears from another pose.
class RelativeView {
 public:
  RelativeView(const Camera& from, const Pose& to)
      : to_from_(glm::conjugate(unit(to.orientation)) * unit(from.world_from_camera.orientation)),
        shift_(glm::conjugate(unit(to.orientation)) *
               (glm::dvec3(from.world_from_camera.position) - glm::dvec3(to.position))),
        focal_(from.focal_px),
        centre_(from.principal_point_px),
        near_z_(from.near_z) {}

  /// Place of a point in the image from the other pose. The point is seen at `pixel` with view
  /// depth `depth` (world units; may be infinite). Infinitely far away if it is not in front of the
  /// camera there.
  [[nodiscard]] glm::dvec2 image_of(const glm::dvec2& pixel, double depth) const {
    const glm::dvec3 ray = to_from_ * glm::dvec3((pixel - centre_) / focal_, 1.0);
    const bool far = std::isinf(depth);
    const glm::dvec3 point = far ? ray : ray * depth + shift_;
    if (!(point.z > (far ? 0.0 : near_z_))) {
      return glm::dvec2(std::numeric_limits<double>::infinity());
    }
    return centre_ + focal_ * glm::dvec2(point) / point.z;
  }

 private:
  glm::dquat to_from_;
  glm::dvec3 shift_;
  glm::dvec2 focal_, centre_;
  double near_z_;
};

/// Calls visit(pixel, depth) for a grid of image points, at `nearest_depth` and at infinity.
template <class Visit>
void for_each_point(const Camera& camera, float nearest_depth, const Visit& visit) {
  for (int row = 0; row <= grid_steps; ++row) {
    for (int column = 0; column <= grid_steps; ++column) {
      const glm::dvec2 pixel =
          glm::dvec2(camera.size_px) * glm::dvec2(column, row) / static_cast<double>(grid_steps);
      visit(pixel, static_cast<double>(nearest_depth));
      visit(pixel, std::numeric_limits<double>::infinity());
    }
  }
}

}  // namespace

void check_speculation(const SpeculationSettings& settings) {
  const auto require = [](bool good, std::string_view flag, std::string_view remedy) {
    if (!good) throw InputError(flag, "", "is out of range", remedy);
  };
  require(settings.initial_window >= 0 && settings.initial_window <= max_initial_window, "--window",
          "0 to " + std::to_string(max_initial_window) + " sub-frames");
  require(settings.max_trail_px > 0.0f && std::isfinite(settings.max_trail_px), "--max-trail-px",
          "a positive number of pixels");
  require(settings.min_depth >= 0.0f && std::isfinite(settings.min_depth), "--min-depth",
          "a depth in world units, 0 for twice the near plane");
  require(settings.max_deviation_px >= 0.0f && std::isfinite(settings.max_deviation_px),
          "--max-deviation-px", "a number of pixels");
  require(settings.guard_px >= 0.0f && settings.guard_px <= 64.0f, "--guard-px", "0 to 64 pixels");
}

float speculation_min_depth(const SpeculationSettings& settings, float near_z) {
  return settings.min_depth > 0.0f ? settings.min_depth : 2.0f * near_z;
}

Pose uniform_motion(const Pose& from, const Pose& to, float share) {
  assert(share >= 0.0f && share <= 1.0f);
  return {glm::mix(from.position, to.position, share),
          glm::quat(glm::normalize(glm::slerp(unit(from.orientation), unit(to.orientation),
                                              static_cast<double>(share))))};
}

float max_displacement_px(const Camera& now, const Pose& end, float nearest_depth,
                          glm::ivec2 end_shift_px) {
  assert(nearest_depth > 0.0f);
  const RelativeView view(now, end);
  const glm::dvec2 shift(end_shift_px);
  double largest = 0.0;
  for_each_point(now, nearest_depth, [&](const glm::dvec2& pixel, double depth) {
    largest = std::max(largest, glm::distance(pixel, view.image_of(pixel, depth) + shift));
  });
  return static_cast<float>(largest);
}

float max_deviation_px(const Camera& key, const Pose& end, const Pose& now, float nearest_depth,
                       glm::ivec2 end_shift_px, glm::ivec2 now_shift_px) {
  assert(nearest_depth > 0.0f);
  const RelativeView end_view(key, end), now_view(key, now);
  const glm::dvec2 end_shift(end_shift_px), now_shift(now_shift_px);
  double largest = 0.0;
  for_each_point(key, nearest_depth, [&](const glm::dvec2& pixel, double depth) {
    const glm::dvec2 trail = end_view.image_of(pixel, depth) + end_shift - pixel;
    const glm::dvec2 moved = now_view.image_of(pixel, depth) + now_shift - pixel;
    if (std::isinf(trail.x) || std::isinf(moved.x)) {
      largest = std::numeric_limits<double>::infinity();
      return;
    }
    const double length2 = glm::dot(trail, trail);
    const double share =
        length2 > 0.0 ? std::clamp(glm::dot(moved, trail) / length2, 0.0, 1.0) : 0.0;
    largest = std::max(largest, glm::distance(moved, share * trail));
  });
  return static_cast<float>(largest);
}

int speculation_window(int initial_window, float max_trail_px, float displacement_px) {
  assert(initial_window >= 0 && max_trail_px > 0.0f && displacement_px >= 0.0f);
  if (displacement_px <= max_trail_px) return initial_window;
  return static_cast<int>(static_cast<double>(initial_window) * max_trail_px / displacement_px);
}

FrameGroups::FrameGroups(const SpeculationSettings& settings) : settings_(settings) {
  check_speculation(settings);
}

FramePlan FrameGroups::plan(const Camera& now, const std::optional<Forecast>& forecast,
                            const SceneDepths& depths) {
  SceneDepths known = depths;
  const float min_depth = speculation_min_depth(settings_, now.near_z);
  if (!(known.nearest > min_depth)) known.nearest = min_depth;
  if (!(known.mean_inverse > 0.0f)) known.mean_inverse = 1.0f / min_depth;
  if (forecast && continues(now, known)) {
    ++drawn_;
    return sub_frame(now);
  }
  key_ = now;
  drawn_ = 0;
  group_ = {};
  group_.window_end = now;
  group_.grid = image_grid(now.size_px);
  group_.list_near_z = now.near_z;
  if (forecast && forecast->frames > 0) begin_group(now, *forecast, known);
  return group_;
}

/// Finds the window of the group that begins with a key frame, and what its lists have to cover.
void FrameGroups::begin_group(const Camera& now, const Forecast& forecast,
                              const SceneDepths& depths) {
  const auto after = [&](int frames) {
    return uniform_motion(now.world_from_camera, forecast.world_from_camera,
                          static_cast<float>(frames) / static_cast<float>(forecast.frames));
  };
  const bool warps = settings_.grid == GridKind::warp;
  const bool shifts = settings_.grid == GridKind::shift;
  // The pose that lists have to reach to for a camera that is at `pose` by then.
  const auto end_of = [&](const Pose& pose) {
    return warps ? Pose{pose.position, now.world_from_camera.orientation} : pose;
  };
  const auto shift_of = [&](const Pose& pose) {
    return shifts ? image_shift_px(now, pose) : glm::ivec2(0);
  };
  // The forecast says nothing about the time after its last frame.
  const int longest = std::min(settings_.initial_window, forecast.frames);
  const Pose last = after(longest);
  int window =
      speculation_window(longest, settings_.max_trail_px,
                         max_displacement_px(now, end_of(last), depths.nearest, shift_of(last)));
  if (warps) {
    const double tau =
        std::min(most_tau(now), settings_.guard_px / (std::max(now.focal_px.x, now.focal_px.y) *
                                                      double{depths.mean_inverse}));
    for (;; --window) {
      guard_ = make_guard_set(now, after(window), tau);
      if (window == 0 || in_guard_set(guard_, now, after(window), after(window))) break;
    }
  }
  if (window == 0) return;
  const Pose end = after(window);
  group_.window = window;
  group_.window_end = at_pose(now, end_of(end));
  if (warps) {
    group_.grid = guard_.grid;
    group_.growth = list_growth(now, guard_);
    group_.list_near_z = guarded_near_z(now, guard_);
  } else if (shifts) {
    const auto slack = static_cast<int>(std::ceil(settings_.max_deviation_px)) + 1;
    const glm::ivec2 shift = image_shift_px(now, end);
    group_.trail_shift_px = shift;
    group_.grid = covering_grid(glm::dvec2(glm::min(shift, 0) - slack),
                                glm::dvec2(now.size_px + glm::max(shift, 0) + slack));
  }
}

FramePlan FrameGroups::sub_frame(const Camera& now) const {
  FramePlan plan = group_;
  plan.kind = FrameKind::sub;
  const Pose& pose = now.world_from_camera;
  if (settings_.grid == GridKind::warp) {
    plan.warped = true;
    plan.list_from_frame = image_turn(key_, pose);
  } else if (settings_.grid == GridKind::shift) {
    plan.shift_px = image_shift_px(key_, pose);
    plan.list_from_frame.x = plan.shift_px.x;
    plan.list_from_frame.y = plan.shift_px.y;
  }
  return plan;
}

/// Whether the group's lists hold everything that the next frame shows. A deviation at infinity
/// comes from rotation alone, so the bound in pixels bounds the angle too.
bool FrameGroups::continues(const Camera& now, const SceneDepths& depths) const {
  if (drawn_ >= group_.window || !same_lens(now, key_)) return false;
  const Pose& pose = now.world_from_camera;
  const Pose& end = group_.window_end.world_from_camera;
  if (settings_.grid == GridKind::warp) return in_guard_set(guard_, key_, end, pose);
  glm::ivec2 shift(0);
  if (settings_.grid == GridKind::shift) {
    shift = image_shift_px(key_, pose);
    const glm::ivec2 last = group_.grid.first_px + group_.grid.size_px;
    if (glm::any(glm::lessThan(shift, group_.grid.first_px)) ||
        glm::any(glm::greaterThan(shift + now.size_px, last)))
      return false;
  }
  return max_deviation_px(key_, end, pose, depths.nearest, group_.trail_shift_px, shift) <=
         settings_.max_deviation_px;
}

}  // namespace catgs
