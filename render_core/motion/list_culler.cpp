#include "render_core/motion/list_culler.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/math/constants.h"
#include "render_core/math/growth-inl.h"

namespace catgs {
namespace {

/// The camera, with an image that is the plan's grid and its margin on all sides.
Camera camera_of_grid(Camera camera, const FramePlan& plan) {
  const int margin = static_cast<int>(std::ceil(plan.growth.constant));
  const glm::ivec2 shift = glm::abs(plan.trail_shift_px);
  camera.principal_point_px -= glm::vec2(plan.grid.first_px - margin - shift);
  camera.size_px = plan.grid.size_px + 2 * (margin + shift);
  camera.near_z = plan.list_near_z;
  return camera;
}

/// The largest slope in a camera's image, from its axis.
float steepest_slope(const Camera& camera) {
  const glm::vec2 size(camera.size_px);
  return glm::length(glm::max(camera.principal_point_px, size - camera.principal_point_px) /
                     camera.focal_px);
}

}  // namespace

ListCuller::End::End(const Pose& pose)
    : position(pose.position),
      right(pose.orientation * glm::vec3(1.0f, 0.0f, 0.0f)),
      down(pose.orientation * glm::vec3(0.0f, 1.0f, 0.0f)),
      forward(pose.orientation * glm::vec3(0.0f, 0.0f, 1.0f)) {}

ListCuller::ListCuller(const Camera& camera, const FramePlan& plan)
    : now_(camera_of_grid(camera, plan)),
      end_(camera_of_grid(plan.window_end, plan)),
      start_(camera.world_from_camera),
      window_end_(plan.window_end.world_from_camera),
      growth_(math::convert<float>(plan.growth)),
      near_z_(plan.list_near_z) {
  const auto clamp = static_cast<float>(fov_clamp);
  const float oblique = std::hypot(1.0f, clamp * steepest_slope(camera_of_grid(camera, plan)));
  const float focal_px = std::max(camera.focal_px.x, camera.focal_px.y);
  focal_px_ = focal_px * oblique;
  off_path_ = growth_.parallax / focal_px * oblique;
}

}  // namespace catgs
