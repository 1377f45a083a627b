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

float max_displacement_px(const Camera& now, const Pose& end, float nearest_depth) {
  assert(nearest_depth > 0.0f);
  const RelativeView view(now, end);
  double largest = 0.0;
  for_each_point(now, nearest_depth, [&](const glm::dvec2& pixel, double depth) {
    largest = std::max(largest, glm::distance(pixel, view.image_of(pixel, depth)));
  });
  return static_cast<float>(largest);
}

float max_deviation_px(const Camera& key, const Pose& end, const Pose& now, float nearest_depth) {
  assert(nearest_depth > 0.0f);
  const RelativeView end_view(key, end), now_view(key, now);
  double largest = 0.0;
  for_each_point(key, nearest_depth, [&](const glm::dvec2& pixel, double depth) {
    const glm::dvec2 trail = end_view.image_of(pixel, depth) - pixel;
    const glm::dvec2 moved = now_view.image_of(pixel, depth) - pixel;
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
                            float nearest_depth) {
  const float min_depth = speculation_min_depth(settings_, now.near_z);
  if (!(nearest_depth > min_depth)) nearest_depth = min_depth;
  if (forecast && continues(now, nearest_depth)) {
    ++drawn_;
    FramePlan plan = group_;
    plan.kind = FrameKind::sub;
    return plan;
  }
  key_ = now;
  drawn_ = 0;
  group_ = {.window_end = now};
  if (forecast && forecast->frames > 0) begin_group(now, *forecast, nearest_depth);
  return group_;
}

/// Finds the window of the group that begins with a key frame.
void FrameGroups::begin_group(const Camera& now, const Forecast& forecast, float nearest_depth) {
  const auto after = [&](int frames) {
    return uniform_motion(now.world_from_camera, forecast.world_from_camera,
                          static_cast<float>(frames) / static_cast<float>(forecast.frames));
  };
  // The forecast says nothing about the time after its last frame.
  const int longest = std::min(settings_.initial_window, forecast.frames);
  group_.window = speculation_window(longest, settings_.max_trail_px,
                                     max_displacement_px(now, after(longest), nearest_depth));
  group_.window_end = at_pose(now, after(group_.window));
}

/// Whether the group's lists hold everything that the next frame shows. A deviation at infinity
/// comes from rotation alone, so the bound in pixels bounds the angle too.
bool FrameGroups::continues(const Camera& now, float nearest_depth) const {
  if (drawn_ >= group_.window || !same_lens(now, key_)) return false;
  return max_deviation_px(key_, group_.window_end.world_from_camera, now.world_from_camera,
                          nearest_depth) <= settings_.max_deviation_px;
}

}  // namespace catgs
