#pragma once

#include <array>
#include <cstddef>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// place' = linear * place + offset.
struct AffineMap {
  glm::dmat3 linear{1.0};
  glm::dvec3 offset{0.0};

  [[nodiscard]] glm::dvec3 operator()(const glm::dvec3& position) const {
    return linear * position + offset;
  }
  /// Whether all numbers are finite and the map has an inverse.
  [[nodiscard]] bool usable() const;
};
/// `second` after `first`.
AffineMap operator*(const AffineMap& second, const AffineMap& first);

/// Makes surfels of Gaussians. A disc has no thickness, and a Gaussian needs one; no picture shows
/// this one. The last axis is the disc's normal.
void flatten(GaussianCloud& cloud);

/// Moves, turns, scales and stretches Gaussians. Means and covariances follow the map exactly.
/// Harmonics follow its rotation alone (the orthogonal factor of its polar decomposition), as
/// KHR_gaussian_splatting asks: a stretched sphere of directions has no harmonics of the same
/// degree.
class CloudTransform {
 public:
  /// `map` must be usable.
  explicit CloudTransform(const AffineMap& map);
  /// Gaussian `i`. A rotation that is not finite, or 0, stays so.
  void apply(GaussianCloud& cloud, std::size_t i) const;

 private:
  void apply_to_shape(glm::quat& rotation, glm::vec3& scale) const;

  AffineMap map_;
  glm::dmat3 turn_{1.0};  // the orthogonal factor; a reflection where the map is one
  glm::quat turn_quat_{1.0f, 0.0f, 0.0f, 0.0f};  // of shapes
  double factor_ = 0.0;  // of all scales; 0: the map stretches some directions more than others
  bool turns_ = false;   // whether `turn_` is not the identity
  std::array<std::array<float, 7>, 16> sh_{};  // row of each coefficient, from those of its degree
};

}  // namespace catgs
