#include "render_core/scene/analysis/robust_bounds.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>
#include <vector>

#include "render_core/base/even_sample.h"

namespace catgs {

namespace {

constexpr std::size_t max_sample = std::size_t{1} << 16;

using WeightedValue = std::pair<float, float>;  // value, weight

/// Smallest value that at least `share` of the weight does not exceed; `values` sorted.
float weighted_quantile(const std::vector<WeightedValue>& values, double total, double share) {
  double sum = 0.0;
  for (const auto& [value, weight] : values) {
    sum += weight;
    if (sum >= share * total) return value;
  }
  return values.back().first;
}

}  // namespace

std::optional<Bounds> robust_bounds(const GaussianCloud& cloud, float tail) {
  assert(tail >= 0.0f && tail < 0.5f);
  const EvenSample even(cloud.size(), max_sample);
  std::vector<std::size_t> sample;
  double total = 0.0;
  for (std::size_t k = 0; k < even.size(); ++k) {
    const std::size_t i = even[k];
    const glm::vec3& m = cloud.mean[i];
    const bool usable = std::isfinite(m.x) && std::isfinite(m.y) && std::isfinite(m.z) &&
                        cloud.opacity[i] > 0.0f && cloud.opacity[i] <= 1.0f;
    if (!usable) continue;
    sample.push_back(i);
    total += static_cast<double>(cloud.opacity[i]);
  }
  if (sample.empty()) return std::nullopt;

  Bounds bounds;
  std::vector<WeightedValue> values(sample.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t s = 0; s < sample.size(); ++s)
      values[s] = {cloud.mean[sample[s]][axis], cloud.opacity[sample[s]]};
    std::sort(values.begin(), values.end());
    bounds.min[axis] = weighted_quantile(values, total, static_cast<double>(tail));
    bounds.max[axis] = weighted_quantile(values, total, 1.0 - static_cast<double>(tail));
  }
  return bounds;
}

}  // namespace catgs
