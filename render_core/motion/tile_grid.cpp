#include "render_core/motion/tile_grid.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "render_core/math/constants.h"
#include "render_core/math/homography-inl.h"
#include "render_core/motion/rotation.h"

namespace catgs {
namespace {

// How far a camera may turn away from its key frame's axis. Gaussians follow a turn only to first
// order, so lists grow with its square; and tiles take up to 1 / least_weight^3 as many pixels.
constexpr double most_turn_rad = 5.0 * glm::pi<double>() / 180.0;
constexpr double least_weight = 0.91;

// A turn may differ from its forecast by this much and stay in the lists: at least the margin, and
// more the faster the camera turns.
constexpr double turn_margin_rad = 0.35 * glm::pi<double>() / 180.0;
constexpr double turn_margin_share = 0.25;

// A long lens sees the same margin as more pixels. For the margin, lists therefore extend beyond
// the picture by at most half of it, and end where their grid would be larger than this many
// pictures.
constexpr double most_overscan = 0.5;
constexpr double most_pictures = 3.0;

glm::dvec2 slope_of(const Camera& camera, const glm::dvec2& pixel) {
  return (pixel - glm::dvec2(camera.principal_point_px)) / glm::dvec2(camera.focal_px);
}

/// The corners of the rectangle from `low` to `high`.
std::array<glm::dvec2, 4> corners(const glm::dvec2& low, const glm::dvec2& high) {
  return {low, glm::dvec2(high.x, low.y), high, glm::dvec2(low.x, high.y)};
}

/// Largest slope from the view axis in the image and its grid.
double steepest(const Camera& camera, const TileGrid& grid) {
  const glm::dvec2 low(grid.first_px), high = low + glm::dvec2(grid.size_px);
  double steepest = 0.0;
  for (const glm::dvec2& corner : corners(low, high))
    steepest = std::max(steepest, glm::length(slope_of(camera, corner)));
  return steepest;
}

/// The least weight_at() that a turn makes at this slope.
double weight_after(double turn_rad, double slope) {
  return std::cos(turn_rad) - slope * std::sin(turn_rad);
}

/// The largest turn that a picture of this size allows.
double turn_limit_rad(const Camera& camera) {
  const double slope = steepest(camera, image_grid(camera.size_px));
  // cos t - slope sin t = |(1, slope)| cos(t + atan slope)
  const double most =
      std::acos(std::min(1.0, least_weight / std::hypot(1.0, slope))) - std::atan(slope);
  return std::clamp(most, 0.0, most_turn_rad);
}

double rotation_rad(const Pose& from, const Pose& to) {
  return glm::length(rotation_between(from.orientation, to.orientation));
}

double distance_to_path(const glm::dvec3& from, const glm::dvec3& to, const glm::dvec3& point) {
  const glm::dvec3 path = to - from;
  const double length2 = glm::dot(path, path);
  const double share =
      length2 > 0.0 ? std::clamp(glm::dot(point - from, path) / length2, 0.0, 1.0) : 0.0;
  return glm::distance(point, from + share * path);
}

/// Calls visit(point of the key frame's plane) for the corners of the picture from `pose`.
template <class Visit>
void for_each_corner(const Camera& key, const Pose& pose, const Visit& visit) {
  const Homography<double> turn = image_turn(key, pose);
  for (const glm::dvec2& corner : corners(glm::dvec2(0.0), glm::dvec2(key.size_px))) {
    const math::Vec2<double> at = math::apply<double>(turn, {corner.x, corner.y});
    visit(glm::dvec2(at.x, at.y));
  }
}

}  // namespace

TileGrid image_grid(glm::ivec2 size_px) {
  assert(size_px.x > 0 && size_px.y > 0);
  return {glm::ivec2(0), (size_px + (tile_size_px - 1)) / tile_size_px, size_px};
}

TileGrid covering_grid(const glm::dvec2& low, const glm::dvec2& high) {
  assert(low.x <= high.x && low.y <= high.y);
  const auto side = static_cast<double>(tile_size_px);
  const glm::ivec2 first(glm::floor(low / side)), end(glm::ceil(high / side));
  return {first * tile_size_px, end - first, (end - first) * tile_size_px};
}

Homography<double> image_turn(const Camera& key, const Pose& pose) {
  const glm::dvec2 focal(key.focal_px), centre(key.principal_point_px);
  const glm::dmat3 rotation =
      glm::mat3_cast(glm::conjugate(glm::normalize(glm::dquat(key.world_from_camera.orientation))) *
                     glm::normalize(glm::dquat(pose.orientation)));
  const glm::dmat3 ray_of_pixel(1.0 / focal.x, 0.0, 0.0, 0.0, 1.0 / focal.y, 0.0,
                                -centre.x / focal.x, -centre.y / focal.y, 1.0);
  const glm::dmat3 pixel_of_ray(focal.x, 0.0, 0.0, 0.0, focal.y, 0.0, centre.x, centre.y, 1.0);
  const glm::dmat3 h = pixel_of_ray * rotation * ray_of_pixel;  // by columns
  return {h[0].x, h[1].x, h[2].x, h[0].y, h[1].y, h[2].y, h[0].z, h[1].z, h[2].z};
}

double axis_turn_rad(const Pose& a, const Pose& b) {
  const glm::dvec3 forward(0.0, 0.0, 1.0);
  const glm::dvec3 of_a = glm::normalize(glm::dquat(a.orientation)) * forward;
  const glm::dvec3 of_b = glm::normalize(glm::dquat(b.orientation)) * forward;
  return std::atan2(glm::length(glm::cross(of_a, of_b)), glm::dot(of_a, of_b));
}

glm::ivec2 image_shift_px(const Camera& key, const Pose& pose) {
  const glm::dvec2 centre = 0.5 * glm::dvec2(key.size_px);
  const Homography<double> turn = image_turn(key, pose);
  if (!(math::weight_at<double>(turn, {centre.x, centre.y}) > 0.0)) return key.size_px;
  const auto at = math::apply<double>(turn, {centre.x, centre.y});
  const glm::dvec2 shift = glm::round(glm::dvec2(at.x, at.y) - centre);
  const glm::dvec2 most(key.size_px);  // beyond it the pictures have nothing in common
  return glm::ivec2(glm::clamp(shift, -most, most));
}

double most_tau(const Camera& key) { return 0.1 * key.near_z; }

GuardSet make_guard_set(const Camera& key, const Pose& end, double tau) {
  assert(tau >= 0.0 && tau <= most_tau(key));
  const Pose& start = key.world_from_camera;
  const double rotation = rotation_rad(start, end);
  const double margin = turn_margin_rad + turn_margin_share * rotation;
  GuardSet guard;
  guard.tau = tau;
  guard.max_rotation_rad = rotation + margin;
  guard.max_turn_rad = std::min(axis_turn_rad(start, end) + margin, turn_limit_rad(key));
  guard.grid = image_grid(key.size_px);
  if (axis_turn_rad(start, end) > guard.max_turn_rad) return guard;
  glm::dvec2 low(0.0), high(key.size_px);
  for (const double share : {0.5, 1.0}) {
    const Pose pose{glm::vec3(0.0f), glm::quat(glm::slerp(glm::dquat(start.orientation),
                                                          glm::dquat(end.orientation), share))};
    for_each_corner(key, pose, [&](const glm::dvec2& point) {
      low = glm::min(low, point);
      high = glm::max(high, point);
    });
  }
  const glm::dvec2 size(key.size_px);
  // In a picture of few pixels, another tile costs little.
  constexpr double some_tiles = 4.0 * tile_size_px;
  if (glm::any(glm::greaterThan(high - low, most_pictures * size + some_tiles))) return guard;
  // A turn by a moves a point at the slope s by f (1 + s^2) a.
  const auto reach = [&](const glm::dvec2& edge) {
    const glm::dvec2 slope = slope_of(key, edge);
    return glm::min(margin * glm::dvec2(key.focal_px) * (1.0 + slope * slope),
                    most_overscan * size + some_tiles);
  };
  guard.grid = covering_grid(low - reach(low), high + reach(high));
  return guard;
}

bool in_guard_set(const GuardSet& guard, const Camera& key, const Pose& end, const Pose& pose) {
  const Pose& start = key.world_from_camera;
  if (axis_turn_rad(start, pose) > guard.max_turn_rad) return false;
  if (rotation_rad(start, pose) > guard.max_rotation_rad) return false;
  if (distance_to_path(start.position, end.position, pose.position) > guard.tau) return false;
  const glm::dvec2 low(guard.grid.first_px), high = low + glm::dvec2(guard.grid.size_px);
  bool inside = true;
  for_each_corner(key, pose, [&](const glm::dvec2& point) {
    inside = inside && glm::all(glm::greaterThanEqual(point, low)) &&
             glm::all(glm::lessThanEqual(point, high));
  });
  return inside;
}

ListGrowth<double> list_growth(const Camera& key, const GuardSet& guard) {
  const double slope = steepest(key, guard.grid);
  const double sine = std::sin(guard.max_turn_rad);
  const double weight = weight_after(guard.max_turn_rad, slope);
  // H(p + d) = H(p) + DH d / (1 + e) with e = grad w . d / w and |grad w| <= sin(turn) / f.
  const double curvature = sine / (std::min(key.focal_px.x, key.focal_px.y) * weight * weight);
  // Depths are those from the path. A camera that is tau nearer sees them reduced by tau.
  const double parallax = std::max(key.focal_px.x, key.focal_px.y) * guard.tau /
                          (1.0 - guard.tau / guarded_near_z(key, guard));
  // A splat that consists of low-pass filter alone does not follow the image's scale, which a turn
  // changes by at most 1 / weight^2.
  const double low_pass_radius =
      std::sqrt(low_pass_px2 * -2.0 * std::log(alpha_min));  // of an opaque splat
  const double low_pass = low_pass_radius * (1.0 / (weight * weight) - 1.0);
  // Tiles are closed squares, and a turn brings pixel centres anywhere in them.
  const double constant = 0.5 + low_pass;
  // Slopes that stay inside the linearisation's limits (fov_clamp) after any turn. At all others
  // the projection may be linearised at another slope than the turn of the picture leads to. A
  // Gaussian's outline then changes by the difference times its depth, which is at most a radius.
  const glm::dvec2 size(key.size_px);
  const glm::dvec2 margin = 0.5 * (fov_clamp - 1.0) * size / glm::dvec2(key.focal_px);
  const glm::dvec2 low = slope_of(key, glm::dvec2(0.0)) - margin;
  const glm::dvec2 high = slope_of(key, size) + margin;
  const auto inwards = [&](double s) { return guard.max_rotation_rad * (1.0 + s * s); };
  const glm::dvec2 limit = glm::max(glm::abs(low), glm::abs(high));
  const double wide = inwards(std::max(limit.x, limit.y));
  return {parallax,
          curvature,
          constant,
          wide,
          low.x + inwards(low.x),
          low.y + inwards(low.y),
          high.x - inwards(high.x),
          high.y - inwards(high.y),
          sine,
          std::cos(guard.max_turn_rad),
          slope,
          std::hypot(1.0, limit.x, limit.y)};
}

float guarded_near_z(const Camera& key, const GuardSet& guard) {
  const double slope = steepest(key, guard.grid);
  return static_cast<float>((key.near_z - guard.tau) / weight_after(-guard.max_turn_rad, slope));
}

}  // namespace catgs
