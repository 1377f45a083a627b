#include "render_core/scene/analysis/first_sight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/scene/analysis/voxel_grid.h"

namespace catgs {

namespace {

/// Any unit vector at a right angle to `v`.
glm::vec3 perpendicular(const glm::vec3& v) {
  const glm::vec3 axis = std::abs(v.x) < 0.7f ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
  return glm::normalize(glm::cross(v, axis));
}

// Candidate places for the first camera, around the middle of the content: distances in content
// radii, elevations above it. In rooms the near ones win, around objects the far ones.
constexpr std::array distances = {0.35f, 0.6f, 0.85f, 1.1f, 1.4f, 1.7f, 2.1f, 2.6f};
constexpr std::array elevations_rad = {0.0f, 0.2f, 0.4f};
constexpr int azimuths = 16;
constexpr float two_pi = 6.2831853f;

// The image that views are judged by: 16:9, 53 degrees high.
constexpr int columns = 16, rows = 9;
constexpr float half_height = 0.5f;  // tan(fov_y / 2)
constexpr float half_width = half_height * columns / rows;

// A camera stands in free space when the 27 cells around it would stop less than a tenth of the
// light.
constexpr float free_optical_depth = 0.1f;

// Many objects look equally good from all sides; the usual front then decides.
constexpr float front_preference = 0.1f;

struct WeightedPoint {
  glm::vec3 position;
  float weight;
};

/// The part of the scene that a first view should show.
struct Content {
  Bounds bounds;
  glm::vec3 middle;
  float radius;
  std::vector<WeightedPoint> points;  // an even sample, in and slightly around the bounds
};

Content find_content(const GaussianCloud& cloud) {
  constexpr std::size_t max_points = 1024;
  Content content{robust_bounds(cloud).value_or(Bounds{glm::vec3(-1), glm::vec3(1)}), {}, 0.0f, {}};
  content.middle = 0.5f * (content.bounds.min + content.bounds.max);
  content.radius = std::max(0.5f * glm::distance(content.bounds.min, content.bounds.max), 1e-3f);
  const std::size_t step = std::max<std::size_t>(1, cloud.size() / max_points);
  const glm::vec3 reach = 0.75f * (content.bounds.max - content.bounds.min);
  for (std::size_t i = 0; i < cloud.size(); i += step)
    if (glm::all(glm::lessThan(glm::abs(cloud.mean[i] - content.middle), reach)))
      content.points.push_back({cloud.mean[i], cloud.opacity[i]});
  return content;
}

/// The light that the content stops along a ray: in all, and with each part weighted by its
/// distance up to `radius`.
struct Stopped {
  float all = 0.0f, weighted = 0.0f;
};

Stopped march(const VoxelGrid& grid, const glm::vec3& from, const glm::vec3& ray, float radius) {
  const float step = grid.cell_size();
  const int steps = static_cast<int>(4.0f * radius / step);
  Stopped stopped;
  for (int s = 1; s <= steps && stopped.all < 0.95f; ++s) {
    const float distance = static_cast<float>(s) * step;
    const float part = (1.0f - stopped.all) * -std::expm1(-grid.depth_at(from + distance * ray));
    stopped.all += part;
    stopped.weighted += part * std::min(distance / radius, 1.0f);
  }
  return stopped;
}

/// How much there is to see from `pose`, in 0…1: the mean over the image of the light stopped, with
/// more weight for far content. It thus prefers views that are filled, but not by something right
/// in front of the camera.
float fullness(const VoxelGrid& grid, const Pose& pose, float radius) {
  float sum = 0.0f;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const float x = half_width * (static_cast<float>(2 * column + 1) / columns - 1.0f);
      const float y = half_height * (static_cast<float>(2 * row + 1) / rows - 1.0f);
      const glm::vec3 ray = pose.orientation * glm::normalize(glm::vec3(x, y, 1.0f));
      sum += march(grid, pose.position, ray, radius).weighted;
    }
  return sum / static_cast<float>(rows * columns);
}

/// Share of all directions in which the content stops the light: near 1 in a room, near 0 before an
/// object.
float enclosure(const VoxelGrid& grid, const glm::vec3& position, float radius) {
  constexpr int directions = 48;
  constexpr float golden_angle = 2.3999632f;  // spreads points evenly on a sphere
  float sum = 0.0f;
  for (int d = 0; d < directions; ++d) {
    const float y = static_cast<float>(2 * d + 1) / directions - 1.0f;
    const float ring = std::sqrt(1.0f - y * y), angle = golden_angle * static_cast<float>(d);
    const glm::vec3 ray(ring * std::cos(angle), y, ring * std::sin(angle));
    sum += march(grid, position, ray, radius).all;
  }
  return sum / directions;
}

/// Share of the content that lies inside of the image, a small margin left free.
float share_in_image(const Content& content, const Pose& pose) {
  constexpr float margin = 0.92f;
  const glm::mat3 to_camera = camera_from_world_rotation(pose);
  float inside = 0.0f, all = 1e-12f;
  for (const auto& [position, weight] : content.points) {
    const glm::vec3 p = to_camera * (position - pose.position);
    all += weight;
    if (std::abs(p.x) < margin * half_width * p.z && std::abs(p.y) < margin * half_height * p.z)
      inside += weight;
  }
  return inside / all;
}

/// Content that is cut off by the image's border spoils the view of an object, but is inevitable in
/// a room.
float view_score(const VoxelGrid& grid, const Content& content, const Pose& pose) {
  const float enclosed = enclosure(grid, pose.position, content.radius);
  const float share = share_in_image(content, pose);
  const float framing = glm::mix(share * share, 1.0f, enclosed * enclosed);
  return framing * fullness(grid, pose, content.radius);
}

/// The usual direction of the first look: captures begin near the identity pose, which looks along
/// +z; scenes with z up are by habit seen along +y. A unit vector at a right angle to `up`.
glm::vec3 usual_front(const glm::vec3& up) {
  const glm::vec3 front = std::abs(up.z) < 0.7f ? glm::vec3(0, 0, -1) : glm::vec3(0, -1, 0);
  return glm::normalize(front - glm::dot(front, up) * up);
}

/// The best of the free places around the content; where none is free, a place outside of it.
Pose choose_start_pose(const GaussianCloud& cloud, const Content& content, const glm::vec3& up) {
  const VoxelGrid grid(cloud, content.middle, 2.7f * content.radius);
  const glm::vec3 front = usual_front(up), side = glm::cross(up, front);
  const auto pose_at = [&](float distance, float elevation, float azimuth) {
    const glm::vec3 level = std::cos(azimuth) * front + std::sin(azimuth) * side;
    const glm::vec3 direction = std::cos(elevation) * level + std::sin(elevation) * up;
    return look_at(content.middle + distance * content.radius * direction, content.middle, up);
  };
  Pose best = pose_at(distances.back(), elevations_rad[1], 0.0f);
  float best_score = 0.0f;
  for (const float distance : distances)
    for (const float elevation : elevations_rad)
      for (int a = 0; a < azimuths; ++a) {
        const float azimuth = two_pi * static_cast<float>(a) / azimuths;
        const Pose pose = pose_at(distance, elevation, azimuth);
        if (grid.depth_around(pose.position) > free_optical_depth) continue;
        const float score =
            view_score(grid, content, pose) * (1.0f + front_preference * std::cos(azimuth));
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
  const Content content = find_content(cloud);
  const auto& [min, max] = content.bounds;
  hints.focus = content.middle;
  hints.start_pose = choose_start_pose(cloud, content, up);
  hints.near_z = std::min(0.2f, 0.02f * content.radius);
  const glm::vec3& start = hints.start_pose.position;
  hints.limits = {glm::min(min, start) - content.radius, glm::max(max, start) + content.radius};
  return hints;
}

}  // namespace catgs
