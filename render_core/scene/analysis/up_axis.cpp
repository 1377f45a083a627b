#include "render_core/scene/analysis/up_axis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/math/look_at.h"
#include "render_core/scene/analysis/robust_bounds.h"

namespace catgs {
namespace {

constexpr glm::vec3 usual_up(0, -1, 0);
constexpr float horizontal = 0.94f,
                vertical = 0.17f;        // normals of floors and walls: 20, 80 degrees
constexpr float smallest_floor = 0.25f;  // of floor_size(); less is the side of a thing

/// A flat Gaussian: a small piece of some surface.
struct Facet {
  glm::vec3 place, normal;
  float area;
};

std::vector<Facet> sample_facets(const GaussianCloud& cloud, const Bounds& bounds) {
  constexpr std::size_t max_facets = std::size_t{1} << 16;
  constexpr float flat = 0.4f;  // smallest to middle standard deviation
  // Some Gaussians of a background are as large as the scene and would outvote it.
  const float largest = 0.02f * glm::distance(bounds.min, bounds.max);
  const std::size_t step = std::max<std::size_t>(1, (cloud.size() + max_facets - 1) / max_facets);
  std::vector<Facet> facets;
  for (std::size_t i = 0; i < cloud.size(); i += step) {
    const glm::vec3& place = cloud.mean[i];
    if (glm::any(glm::lessThan(place, bounds.min)) || glm::any(glm::greaterThan(place, bounds.max)))
      continue;
    const glm::vec3& scale = cloud.scale[i];
    std::array<int, 3> axes = {0, 1, 2};
    std::ranges::sort(axes, {}, [&](int a) { return scale[a]; });
    if (scale[axes[0]] > flat * scale[axes[1]]) continue;
    const float area = std::min(scale[axes[1]], largest) * std::min(scale[axes[2]], largest);
    facets.push_back({place, glm::mat3_cast(cloud.rotation[i])[axes[0]], cloud.opacity[i] * area});
  }
  return facets;
}

/// Mean normal of the facets within a cone around `axis`, which narrows.
std::optional<glm::vec3> peak_near(const std::vector<Facet>& facets, glm::vec3 axis) {
  for (const float within : {0.80f, 0.90f, 0.95f, 0.97f}) {  // cosines
    glm::vec3 sum(0.0f);
    for (const Facet& facet : facets) {
      const float along = glm::dot(facet.normal, axis);
      if (std::abs(along) > within) sum += std::copysign(facet.area, along) * facet.normal;
    }
    if (!(glm::length(sum) > 0.0f)) return std::nullopt;
    axis = glm::normalize(sum);
  }
  return axis;
}

/// Where the share `share` of sorted values lies.
float quantile(const std::vector<float>& sorted, float share) {
  return sorted[static_cast<std::size_t>(share * static_cast<float>(sorted.size() - 1))];
}

/// Area of the floor that the facets form at a right angle to `up`, relative to the largest side
/// of the box around them. A floor lies in the lower part and spans the plan: facades and sides of
/// things do so too, but are smaller.
float floor_size(const std::vector<Facet>& facets, const glm::vec3& up) {
  constexpr int plan = 20, levels = 64;
  constexpr float lower_part = 0.4f;
  const glm::vec3 a = perpendicular(up), b = glm::cross(up, a);
  glm::vec3 low, extent;
  std::vector<float> values(facets.size());
  const glm::mat3 axes(a, b, up);
  for (int k = 0; k < 3; ++k) {
    std::ranges::transform(facets, values.begin(),
                           [&](const Facet& f) { return glm::dot(f.place, axes[k]); });
    std::ranges::sort(values);
    low[k] = quantile(values, 0.02f);
    extent[k] = std::max(quantile(values, 0.98f) - low[k], 1e-6f);
  }
  const auto place = [&](const Facet& f) {  // 0…1 in the box
    return (glm::vec3(glm::dot(f.place, a), glm::dot(f.place, b), glm::dot(f.place, up)) - low) /
           extent;
  };
  std::array<float, levels> area{};
  const auto level_of = [&](float height) {
    return static_cast<int>(std::clamp(height * levels, 0.0f, levels - 1.0f));
  };
  for (const Facet& f : facets)
    if (std::abs(glm::dot(f.normal, up)) > horizontal)
      area[static_cast<std::size_t>(level_of(place(f).z))] += f.area;
  const auto lowest_levels = area.begin() + static_cast<int>(lower_part * levels);
  const int floor = static_cast<int>(std::max_element(area.begin(), lowest_levels) - area.begin());
  std::vector<char> covered(plan * plan);
  for (const Facet& f : facets) {
    const glm::vec3 p = place(f);
    if (std::abs(glm::dot(f.normal, up)) < horizontal || std::abs(level_of(p.z) - floor) > 1)
      continue;
    if (!(p.x >= 0.0f && p.x < 1.0f && p.y >= 0.0f && p.y < 1.0f)) continue;
    const glm::ivec2 cell = glm::min(glm::ivec2(static_cast<float>(plan) * glm::vec2(p)), plan - 1);
    covered[static_cast<std::size_t>(cell.y * plan + cell.x)] = 1;
  }
  const float share = static_cast<float>(std::ranges::count(covered, 1)) / (plan * plan);
  const float smallest = std::min({extent.x, extent.y, extent.z});
  return share * smallest / extent.z;
}

/// How usual it is that a scene has this up: captures of COLMAP have y down, surveys have z up,
/// some tools turn y up.
float habit(const glm::vec3& up) {
  return std::max(
      {0.2f, -up.y * std::abs(up.y), 0.6f * up.z * std::abs(up.z), 0.4f * up.y * std::abs(up.y)});
}

/// The axis above the largest floor.
glm::vec3 above_largest_floor(const std::vector<Facet>& facets) {
  glm::vec3 best = usual_up;
  float best_score = smallest_floor;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        const auto axis = peak_near(facets, glm::normalize(glm::vec3(x, y, z)));
        if (!axis) continue;
        const float score = habit(*axis) * floor_size(facets, *axis);
        if (score > best_score) {
          best_score = score;
          best = *axis;
        }
      }
  return best;
}

/// Sum of the cameras' up vectors over their number; short where they cancel out.
glm::vec3 mean_up(std::span<const Pose> cameras) {
  glm::vec3 sum(0.0f);
  for (const Pose& pose : cameras) sum += pose.orientation * usual_up;
  return sum / static_cast<float>(std::max<std::size_t>(1, cameras.size()));
}

/// The unit vector u that minimises the mean of (u · r)² over the cameras' right vectors r and the
/// walls' normals, and of |u - (u · n) n|² over the floors' normals n, with a weak pull towards
/// `guess` for the directions that none of them determines: (A + e I) u ~ e guess, the stationary
/// point of a quadratic form.
glm::vec3 level(const glm::vec3& guess, const std::vector<Facet>& facets,
                std::span<const Pose> cameras) {
  constexpr float pull = 1e-3f;
  constexpr float trust = 0.5f;  // in surfaces, relative to cameras
  glm::mat3 from_cameras(0.0f);
  for (const Pose& pose : cameras) {
    const glm::vec3 right = pose.orientation * glm::vec3(1, 0, 0);
    from_cameras += glm::outerProduct(right, right) / static_cast<float>(cameras.size());
  }
  float area = 1e-30f;
  for (const Facet& facet : facets) area += facet.area;
  glm::vec3 up = guess;
  for (int round = 0; round < 4; ++round) {
    glm::mat3 form = from_cameras + glm::mat3(pull);
    for (const Facet& facet : facets) {
      const float along = std::abs(glm::dot(facet.normal, up));
      const glm::mat3 square = glm::outerProduct(facet.normal, facet.normal);
      const float weight = trust * facet.area / area;
      if (along > horizontal) form += weight * (glm::mat3(1.0f) - square);
      if (along < vertical) form += weight * square;
    }
    up = glm::normalize(glm::inverse(form) * guess);
  }
  return up;
}

}  // namespace

glm::vec3 find_up(const GaussianCloud& cloud, std::span<const Pose> cameras) {
  std::vector<Facet> facets;
  if (const auto bounds = robust_bounds(cloud, 0.01f)) facets = sample_facets(cloud, *bounds);
  const glm::vec3 held = mean_up(cameras);
  if (glm::length(held) < 0.2f) cameras = {};  // none, or those of a drone that looks straight down
  const glm::vec3 guess =
      cameras.empty() ? above_largest_floor(facets) : level(glm::normalize(held), {}, cameras);
  // The surfaces of a thing without a floor are level by chance only.
  const auto axis = peak_near(facets, guess);
  const bool has_floor =
      axis && glm::dot(*axis, guess) > horizontal && floor_size(facets, guess) > smallest_floor;
  return has_floor ? level(guess, facets, cameras) : guess;
}

}  // namespace catgs
