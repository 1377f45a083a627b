#include "render_core/cpu/list_culler.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/math/constants.h"
#include "render_core/math/growth-inl.h"

namespace catgs {
namespace {

/// The camera, with the plan's grid and what that grows by on all sides as its image.
Camera camera_of_grid(Camera camera, const FramePlan& plan) {
  const int margin = static_cast<int>(std::ceil(plan.growth.constant));
  const glm::ivec2 shift = glm::abs(plan.trail_shift_px);
  camera.principal_point_px -= glm::vec2(plan.grid.first_px - margin - shift);
  camera.size_px = plan.grid.size_px + 2 * (margin + shift);
  camera.near_z = plan.list_near_z;
  return camera;
}

/// Of a camera's image from its axis.
float steepest_slope(const Camera& camera) {
  const glm::vec2 size(camera.size_px);
  return glm::length(glm::max(camera.principal_point_px, size - camera.principal_point_px) /
                     camera.focal_px);
}

}  // namespace

ListCuller::ListCuller(const Camera& camera, const FramePlan& plan)
    : now_(camera_of_grid(camera, plan)),
      end_(camera_of_grid(plan.window_end, plan)),
      start_(camera.world_from_camera),
      window_end_(plan.window_end.world_from_camera),
      growth_(math::convert<float>(plan.growth)),
      position_(camera.world_from_camera.position),
      forward_(camera.world_from_camera.orientation * glm::vec3(0.0f, 0.0f, 1.0f)),
      near_z_(plan.list_near_z),
      focal_px_(std::max(camera.focal_px.x, camera.focal_px.y)),
      parallax_(static_cast<float>(plan.growth.parallax) / focal_px_),
      curvature_(static_cast<float>(plan.growth.curvature)),
      wide_(static_cast<float>(plan.growth.wide)) {
  const auto clamp = static_cast<float>(fov_clamp);
  const float oblique = std::hypot(1.0f, clamp * steepest_slope(camera_of_grid(camera, plan)));
  parallax_ *= oblique;
  focal_px_ *= oblique;  // so that it bounds a splat's radius
}

bool ListCuller::outside(const Cluster& cluster) const {
  return outside_on_the_way(now_, end_, grown(cluster)) && !turns_in(cluster, start_) &&
         !turns_in(cluster, window_end_);
}

/// may_turn_in() of any Gaussian in the cluster.
bool ListCuller::turns_in(const Cluster& cluster, const Pose& pose) const {
  const glm::vec3 at = glm::conjugate(pose.orientation) * (cluster.centre - pose.position);
  const float radius = glm::length(cluster.half_extent);
  return math::may_turn_in<float>(growth_, {at.x, at.y, at.z},
                                  cluster.reach + radius * (1.0f + growth_.steepest),
                                  near_z_ - radius * (growth_.turn_cosine + growth_.turn_sine));
}

/// growth_px() as a longer reach: by the camera's way off, and by shares of the splats' radii.
Cluster ListCuller::grown(const Cluster& cluster) const {
  Cluster result = cluster;
  const float depth = glm::dot(forward_, cluster.centre - position_) -
                      glm::dot(glm::abs(forward_), cluster.half_extent);
  const float radius_px = focal_px_ * cluster.reach / std::max(depth, near_z_);
  result.reach *= 1.0f + wide_ + curvature_ * radius_px;
  result.reach += parallax_;
  return result;
}

}  // namespace catgs
