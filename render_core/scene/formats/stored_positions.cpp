#include "render_core/scene/formats/stored_positions.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <glm/common.hpp>

#include "render_core/scene/formats/calm_range.h"
#include "render_core/scene/formats/losses.h"

namespace catgs {
namespace {

constexpr std::size_t least_count = 64, share_of_far = 256, most_far = 8;
constexpr float widest_gap = 0.5f;  // of the others' range
constexpr float least_steps = 256.0f;
constexpr std::size_t most_sampled = 4096;
constexpr float least_scale = 1e-10f;  // as in sanitize()

}  // namespace

StoredPositions::StoredPositions(const GaussianCloud& cloud, float (*stored)(float), float steps)
    : mean_(cloud.mean), scale_(cloud.scale) {
  assert(!cloud.empty());
  glm::vec3 low, high;
  for (int axis = 0; axis < 3; ++axis) {
    const Range range = range_of_most(axis, stored, least_steps / steps);
    low[axis] = range.low;
    high[axis] = range.high;
  }
  const glm::vec3 middle = 0.5f * (low + high), half = high - middle;
  // The box of a flat scene is grown a little, so that nothing is moved to its very middle.
  const glm::vec3 border = glm::max(half, std::max({half.x, half.y, half.z}) / 64.0f);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const glm::vec3& mean = cloud.mean[i];
    if (glm::clamp(mean, low, high) == mean) continue;
    if (moved_mean_.empty()) {
      moved_mean_ = cloud.mean;
      moved_scale_ = cloud.scale;
    }
    const glm::vec3 beyond = glm::abs(mean - middle) / glm::max(border, 1e-20f);
    const float nearer = 1.0f / std::max({beyond.x, beyond.y, beyond.z, 1.0f});
    moved_mean_[i] = middle + nearer * (mean - middle);
    moved_scale_[i] = glm::max(nearer * cloud.scale[i], least_scale);
  }
  if (moved_mean_.empty()) return;
  mean_ = moved_mean_;
  scale_ = moved_scale_;
}

/// The range of a coordinate without far Gaussians. `per_size`: the part of the stored range below
/// which the median Gaussian's size has too few steps.
StoredPositions::Range StoredPositions::range_of_most(int axis, float (*stored)(float),
                                                      float per_size) const {
  const std::size_t count = mean_.size();
  std::vector<float> at(count);
  for (std::size_t i = 0; i < count; ++i) at[i] = mean_[i][axis];
  const auto [least, most] = std::ranges::minmax(at);
  const Range all{least, most};
  if (count < least_count) return all;

  std::vector<float> sizes(std::min(count, most_sampled));
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const std::size_t of = i * count / sizes.size();
    sizes[i] = stored(at[of] + middle_scale(scale_[of])) - stored(at[of]);
  }
  const auto median = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::ranges::nth_element(sizes, median);
  if (*median >= per_size * (stored(most) - stored(least))) return all;

  const std::size_t far = std::min(most_far, (count + share_of_far - 1) / share_of_far);
  const auto begin = at.begin(), end = at.end();
  const auto tail = static_cast<std::ptrdiff_t>(far) + 1;
  std::nth_element(begin, begin + tail - 1, end);
  std::nth_element(begin + tail, end - tail, end);
  std::sort(begin, begin + tail);
  std::sort(end - tail, end);
  const CalmRange calm =
      calm_range(count, far, widest_gap, [&](std::size_t i) { return stored(at[i]); });
  return {at[calm.first], at[calm.last]};
}

}  // namespace catgs
