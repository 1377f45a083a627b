#include "render_core/scene/first_sight.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/scene/robust_bounds.h"
#include "render_core/scene/voxel_grid.h"

namespace catgs {

namespace {

/// Any unit vector at a right angle to `v`.
glm::vec3 perpendicular(const glm::vec3& v) {
  const glm::vec3 axis = std::abs(v.x) < 0.7f ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
  return glm::normalize(glm::cross(v, axis));
}

// Where a first camera may stand, around the middle of the content: distances in content radii,
// elevations above it. Inside rooms the near ones win, around objects those at 1.4 to 1.7.
constexpr std::array distances = {0.35f, 0.6f, 0.85f, 1.1f, 1.4f, 1.7f, 2.1f};
constexpr std::array elevations_rad = {0.0f, 0.2f, 0.4f};
constexpr int azimuths = 16;
constexpr float two_pi = 6.2831853f;

// A camera stands in free space when the 27 cells around it would stop less than a tenth of the
// light.
constexpr float free_optical_depth = 0.1f;

/// How much there is to see from `pose`: over the rays of a coarse 16:9 image, the light that the
/// content stops, each part weighted by its distance up to `radius`. So it prefers views that are
/// filled, but not by something right in front of the camera.
float view_score(const VoxelGrid& grid, const Pose& pose, float radius) {
  constexpr int columns = 16, rows = 9;
  constexpr float half_height = 0.5f;  // tan(fov_y / 2): 53 degrees
  const float step = grid.cell_size();
  const int steps = static_cast<int>(4.0f * radius / step);
  float score = 0.0f;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const float x = (2.0f * (static_cast<float>(column) + 0.5f) / columns - 1.0f);
      const float y = (2.0f * (static_cast<float>(row) + 0.5f) / rows - 1.0f);
      const glm::vec3 ray =
          pose.orientation *
          glm::normalize(glm::vec3(x * half_height * columns / rows, y * half_height, 1.0f));
      float transmittance = 1.0f;
      for (int s = 1; s <= steps && transmittance > 0.05f; ++s) {
        const float distance = static_cast<float>(s) * step;
        const float stopped =
            transmittance * -std::expm1(-grid.depth_at(pose.position + distance * ray));
        score += stopped * std::min(distance / radius, 1.0f);
        transmittance -= stopped;
      }
    }
  return score / static_cast<float>(rows * columns);
}

/// The best of the free places around `focus`; where none is free, one outside of the content.
Pose choose_start_pose(const GaussianCloud& cloud, const glm::vec3& focus, float radius,
                       const glm::vec3& up) {
  const VoxelGrid grid(cloud, focus, 2.5f * radius);
  const glm::vec3 side = perpendicular(up), front = glm::cross(side, up);
  const auto pose_at = [&](float distance, float elevation, float azimuth) {
    const glm::vec3 level = std::cos(azimuth) * front + std::sin(azimuth) * side;
    const glm::vec3 direction = std::cos(elevation) * level + std::sin(elevation) * up;
    return look_at(focus + distance * radius * direction, focus, up);
  };
  Pose best = pose_at(distances.back(), elevations_rad[1], 0.0f);
  float best_score = 0.0f;
  for (const float distance : distances)
    for (const float elevation : elevations_rad)
      for (int a = 0; a < azimuths; ++a) {
        const Pose pose = pose_at(distance, elevation, two_pi * static_cast<float>(a) / azimuths);
        if (grid.depth_around(pose.position) > free_optical_depth) continue;
        const float score = view_score(grid, pose, radius);
        if (score > best_score) {
          best_score = score;
          best = pose;
        }
      }
  return best;
}

}  // namespace

Pose look_at(const glm::vec3& eye, const glm::vec3& target, const glm::vec3& up) {
  const glm::vec3 view = target - eye;
  const glm::vec3 forward = glm::dot(view, view) > 0.0f ? glm::normalize(view) : perpendicular(up);
  glm::vec3 right = glm::cross(forward, up);
  right = glm::length(right) > 1e-4f ? glm::normalize(right) : perpendicular(forward);
  const glm::vec3 down = glm::cross(forward, right);
  return {eye, glm::normalize(glm::quat_cast(glm::mat3(right, down, forward)))};
}

SceneHints estimate_hints(const GaussianCloud& cloud, const glm::vec3& up) {
  SceneHints hints;
  hints.up = up;
  hints.source = "estimated";
  const Bounds bounds = robust_bounds(cloud).value_or(Bounds{glm::vec3(-1), glm::vec3(1)});
  const float radius = std::max(0.5f * glm::distance(bounds.min, bounds.max), 1e-3f);
  hints.focus = 0.5f * (bounds.min + bounds.max);
  hints.start_pose = choose_start_pose(cloud, hints.focus, radius, up);
  hints.near_z = std::min(0.2f, 0.02f * radius);
  const glm::vec3& start = hints.start_pose.position;
  hints.limits = {glm::min(bounds.min, start) - radius, glm::max(bounds.max, start) + radius};
  return hints;
}

}  // namespace catgs
