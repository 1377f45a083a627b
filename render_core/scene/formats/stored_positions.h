#pragma once

#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Means and scales for a format whose steps between means grow with their range.
///
/// A few Gaussians far from all others would make the steps coarse for every one. Those are moved
/// towards the middle of the others, to the border of their box, and become smaller with their
/// distance: seen from there they look the same. At most one in 256 is moved, and at most eight: a
/// background of more stays where it is, since cameras elsewhere would see it in front of things.
/// The gap is wider than half of the others' range, and steps would otherwise be coarser than 1/256
/// of the median Gaussian.
class StoredPositions {
 public:
  /// `stored`: what the format stores of a coordinate; it grows with it. `steps`: in its range.
  /// `cloud` is not empty, and must outlive the places.
  StoredPositions(const GaussianCloud& cloud, float (*stored)(float), float steps);

  [[nodiscard]] std::span<const glm::vec3> mean() const { return mean_; }
  [[nodiscard]] std::span<const glm::vec3> scale() const { return scale_; }

 private:
  struct Range {
    float low, high;
  };
  [[nodiscard]] Range range_of_most(int axis, float (*stored)(float), float per_size) const;

  std::span<const glm::vec3> mean_, scale_;
  std::vector<glm::vec3> moved_mean_, moved_scale_;  // empty if none is far
};

}  // namespace catgs
