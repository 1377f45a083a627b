#include "render_core/scene/analysis/surface_points.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/base/even_sample.h"
#include "render_core/scene/clusters.h"

namespace catgs {
namespace {

/// Radius of a disc with the area that the Gaussian covers when seen from its broad side.
float disc_radius(const glm::vec3& scale) {
  const float smallest = std::min({scale.x, scale.y, scale.z});
  const float product = scale.x * scale.y * scale.z;
  return std::sqrt(product / std::max(smallest, 1e-12f));
}

/// A Gaussian is invisible beyond this many standard deviations.
constexpr float reach = 3.0f;

/// The place on a ray that is nearest to a point: its distance along the ray, and its squared
/// distance to the point.
struct Approach {
  float along, beside2;
};

Approach approach(const glm::vec3& origin, const glm::vec3& direction, const glm::vec3& point) {
  const glm::vec3 offset = point - origin;
  const float along = glm::dot(offset, direction);
  // A difference of squares would have lost its digits where the point is far.
  const glm::vec3 beside = offset - along * direction;
  return {along, glm::dot(beside, beside)};
}

}  // namespace

SurfacePoints::SurfacePoints(const GaussianCloud& cloud, ThreadPool& pool, std::size_t max_points) {
  const EvenSample sample(cloud.size(), std::max<std::size_t>(1, max_points));
  const float growth =
      std::sqrt(static_cast<float>(sample.step()));  // of discs that stand for more
  std::vector<glm::vec3> centres(sample.size());
  for (std::size_t k = 0; k < centres.size(); ++k) centres[k] = cloud.mean[sample[k]];
  points_.reserve(centres.size());
  for (const std::uint32_t k : morton_order(centres, pool)) {
    const std::size_t i = sample[k];
    points_.push_back({centres[k], growth * disc_radius(cloud.scale[i]), cloud.opacity[i]});
  }
  clusters_.resize(clusters_of(points_.size()));
  for (std::size_t c = 0; c < clusters_.size(); ++c) clusters_[c] = around(points_of(c));
}

std::span<const SurfacePoints::Point> SurfacePoints::points_of(std::size_t cluster) const {
  const std::size_t first = cluster * cluster_size;
  return std::span(points_).subspan(first, std::min(cluster_size, points_.size() - first));
}

SurfacePoints::Ball SurfacePoints::around(std::span<const Point> points) {
  glm::vec3 low = points.front().centre, high = low;
  for (const Point& point : points) {
    low = glm::min(low, point.centre);
    high = glm::max(high, point.centre);
  }
  Ball ball{0.5f * (low + high)};
  for (const Point& point : points)
    ball.radius =
        std::max(ball.radius, glm::distance(ball.centre, point.centre) + reach * point.sigma);
  return ball;
}

template <typename Visit>
void SurfacePoints::for_points_on(const glm::vec3& origin, const glm::vec3& direction,
                                  float farthest, const Visit& visit) const {
  assert(std::abs(glm::length(direction) - 1.0f) < 1e-3f);
  for (std::size_t c = 0; c < clusters_.size(); ++c) {
    const Ball& ball = clusters_[c];
    const Approach passes = approach(origin, direction, ball.centre);
    if (passes.along < -ball.radius || passes.along > farthest + ball.radius ||
        passes.beside2 > ball.radius * ball.radius)
      continue;
    for (const Point& point : points_of(c)) {
      const auto [along, beside2] = approach(origin, direction, point.centre);
      const float sigma2 = point.sigma * point.sigma;
      // The balls around the camera are no target.
      if (along <= point.sigma || along >= farthest || beside2 > reach * reach * sigma2) continue;
      if (!visit(along, point.opacity * std::exp(-0.5f * beside2 / sigma2))) return;
    }
  }
}

float SurfacePoints::light_from(const glm::vec3& origin, const glm::vec3& direction, float distance,
                                float enough) const {
  float left = 1.0f;
  for_points_on(origin, direction, distance, [&](float, float alpha) {
    left *= 1.0f - alpha;
    return left >= enough;
  });
  return left;
}

std::optional<SurfacePoints::Hit> SurfacePoints::hit_along(const glm::vec3& origin,
                                                           const glm::vec3& direction) const {
  std::vector<std::pair<float, float>> stops;  // distance, alpha
  for_points_on(origin, direction, std::numeric_limits<float>::max(),
                [&](float distance, float alpha) {
                  stops.emplace_back(distance, alpha);
                  return true;
                });
  std::ranges::sort(stops);
  std::optional<float> first, middle;
  float last = 0.0f, left = 1.0f;
  for (const auto& [distance, alpha] : stops) {
    left *= 1.0f - alpha;
    last = distance;
    if (!first && left <= 0.84f) first = distance;
    if (!middle && left <= 0.5f) middle = distance;
    if (left <= 0.16f) break;
  }
  if (!middle) return std::nullopt;
  return Hit{*middle, 0.5f * (last - *first)};
}

}  // namespace catgs
