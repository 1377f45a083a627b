#include "render_core/tools/walk/sight_line.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/vector_relational.hpp>

namespace catgs {
namespace {

constexpr float reach = 3.4f;  // standard deviations; alpha is under 1/255 beyond

float largest(const glm::vec3& v) { return std::max({v.x, v.y, v.z}); }

bool misses(const Cluster& cluster, const glm::vec3& low, const glm::vec3& high) {
  const glm::vec3 grown = cluster.half_extent + cluster.reach;
  return glm::any(glm::lessThan(high, cluster.centre - grown)) ||
         glm::any(glm::greaterThan(low, cluster.centre + grown));
}

/// Share of a normal distribution between two places.
float normal_share(float low, float high) {
  constexpr float root_half = 0.70710678f;
  return 0.5f * (std::erf(high * root_half) - std::erf(low * root_half));
}

}  // namespace

SightLines::SightLines(const GaussianCloud& cloud, ThreadPool& pool)
    : cloud_(cloud), order_(morton_order(cloud.mean, pool)) {
  // A few large Gaussians would make the bounds of every cluster large.
  std::ranges::stable_sort(order_, {}, [&](std::uint32_t i) {
    return static_cast<int>(std::floor(std::log2(largest(cloud.scale[i]))));
  });
  clusters_.resize(clusters_of(order_.size()));
  pool.parallel_for(clusters_.size(), [&](std::size_t c) {
    ClusterBounds bounds;
    for (std::size_t k = c * cluster_size; k < std::min(order_.size(), (c + 1) * cluster_size); ++k)
      bounds.add(cloud.mean[order_[k]], static_cast<double>(largest(cloud.scale[order_[k]])),
                 std::log2(cloud.opacity[order_[k]]));
    clusters_[c] = bounds.cluster();
  });
}

float SightLines::light_between(const glm::vec3& from, const glm::vec3& to) const {
  const glm::vec3 low = glm::min(from, to), high = glm::max(from, to);
  const glm::vec3 middle = 0.5f * (from + to);
  const float half_length = 0.5f * glm::distance(from, to);
  float depth = 0.0f;
  for (std::size_t c = 0; c < clusters_.size(); ++c) {
    if (misses(clusters_[c], low, high)) continue;
    for (std::size_t k = c * cluster_size; k < std::min(order_.size(), (c + 1) * cluster_size);
         ++k) {
      const std::uint32_t i = order_[k];
      const glm::vec3 off = cloud_.mean[i] - middle;
      const float within = half_length + reach * largest(cloud_.scale[i]);
      if (glm::dot(off, off) > within * within) continue;
      // In the Gaussian's own axes it is a unit ball.
      const glm::mat3 to_axes = glm::mat3_cast(glm::conjugate(cloud_.rotation[i]));
      const glm::vec3 a = to_axes * (from - cloud_.mean[i]) / cloud_.scale[i];
      const glm::vec3 b = to_axes * (to - cloud_.mean[i]) / cloud_.scale[i];
      const float length = glm::distance(a, b);
      if (!(length > 0.0f)) continue;
      const glm::vec3 direction = (b - a) / length;
      const float nearest = -glm::dot(a, direction);
      const glm::vec3 beside = a + nearest * direction;
      const float alpha = cloud_.opacity[i] * std::exp(-0.5f * glm::dot(beside, beside));
      if (alpha < 1.0f / 255.0f) continue;
      depth -= std::log1p(-std::min(alpha, 0.999f)) * normal_share(-nearest, length - nearest);
    }
  }
  return std::exp(-depth);
}

}  // namespace catgs
