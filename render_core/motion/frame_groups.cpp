#include "render_core/motion/frame_groups.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>

#include <glm/common.hpp>
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

glm::ivec2 middle_shift_px(const Camera& key, const Pose& now, float depth) {
  const glm::dvec2 middle = 0.5 * glm::dvec2(key.size_px);
  const glm::dvec2 image = RelativeView(key, now).image_of(middle, static_cast<double>(depth));
  const glm::dvec2 shift = glm::round(image - middle);
  const glm::dvec2 far(2.0 * max_coordinate);
  return glm::ivec2(glm::clamp(shift, -far, far));
}

float max_displacement_px(const Camera& now, const Pose& end, float nearest_depth,
                          glm::ivec2 end_shift_px) {
  assert(nearest_depth > 0.0f);
  const RelativeView view(now, end);
  double largest = 0.0;
  for_each_point(now, nearest_depth, [&](const glm::dvec2& pixel, double depth) {
    const glm::dvec2 image = view.image_of(pixel, depth) - glm::dvec2(end_shift_px);
    largest = std::max(largest, glm::distance(pixel, image));
  });
  return static_cast<float>(largest);
}

float max_deviation_px(const Camera& key, const Pose& end, const Pose& now, float nearest_depth,
                       glm::ivec2 end_shift_px, glm::ivec2 shift_px) {
  assert(nearest_depth > 0.0f);
  const RelativeView end_view(key, end), now_view(key, now);
  double largest = 0.0;
  for_each_point(key, nearest_depth, [&](const glm::dvec2& pixel, double depth) {
    const glm::dvec2 trail = end_view.image_of(pixel, depth) - pixel - glm::dvec2(end_shift_px);
    const glm::dvec2 moved = now_view.image_of(pixel, depth) - pixel - glm::dvec2(shift_px);
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

FrameGroups::FrameGroups(const SpeculationSettings& settings, TileGrid grid)
    : settings_(settings), grid_(grid) {
  check_speculation(settings);
}

FramePlan FrameGroups::plan(const Camera& now, const std::optional<Forecast>& forecast,
                            float depth) {
  const float min_depth = speculation_min_depth(settings_, now.near_z);
  if (!(depth > min_depth)) depth = min_depth;
  if (forecast && continues(now, depth)) {
    ++drawn_;
    FramePlan plan = group_;
    plan.kind = FrameKind::sub;
    return plan;
  }
  key_ = now;
  depth_ = depth;
  drawn_ = 0;
  group_ = {.window_end = now};
  if (forecast && forecast->frames > 0) begin_group(now, *forecast, depth);
  return group_;
}

/// Finds the window of the group that begins with a key frame.
void FrameGroups::begin_group(const Camera& now, const Forecast& forecast, float depth) {
  const auto after = [&](int frames) {
    return uniform_motion(now.world_from_camera, forecast.world_from_camera,
                          static_cast<float>(frames) / static_cast<float>(forecast.frames));
  };
  const auto shift_of = [&](const Pose& end) {
    return grid_ == TileGrid::follows ? middle_shift_px(now, end, depth) : glm::ivec2(0);
  };
  // The forecast says nothing about the time after its last frame.
  const int longest = std::min(settings_.initial_window, forecast.frames);
  const Pose last = after(longest);
  const glm::ivec2 shift = shift_of(last);
  const auto travel = static_cast<float>(std::max(std::abs(shift.x), std::abs(shift.y)));
  group_.window = std::min(speculation_window(longest, settings_.max_trail_px,
                                              max_displacement_px(now, last, depth, shift)),
                           speculation_window(longest, static_cast<float>(most_travel_px), travel));
  group_.window_end = at_pose(now, after(group_.window));
  group_.end_shift_px = glm::clamp(shift_of(group_.window_end.world_from_camera),
                                   glm::ivec2(-most_travel_px), glm::ivec2(most_travel_px));
}

/// Whether the group's lists hold everything that the next frame shows. Notes where their grid is
/// in it. A deviation at infinity comes from rotation alone, so the bound in pixels bounds the
/// angle too.
bool FrameGroups::continues(const Camera& now, float depth) {
  if (drawn_ >= group_.window || !same_lens(now, key_)) return false;
  if (grid_ == TileGrid::follows) {
    depth = depth_;
    const glm::ivec2 shift = middle_shift_px(key_, now.world_from_camera, depth_);
    const glm::ivec2 low = glm::min(glm::ivec2(0), group_.end_shift_px) - most_extra_turn_px;
    const glm::ivec2 high = glm::max(glm::ivec2(0), group_.end_shift_px) + most_extra_turn_px;
    if (glm::clamp(shift, low, high) != shift) return false;
    group_.shift_px = shift;
  }
  return max_deviation_px(key_, group_.window_end.world_from_camera, now.world_from_camera, depth,
                          group_.end_shift_px, group_.shift_px) <= settings_.max_deviation_px;
}

}  // namespace catgs
