#pragma once

#include <array>
#include <cassert>

#include <glm/common.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// (x, y, z) to (x, -z, y): from y up to z up, and also from z up (y to the front) to right, down,
/// front.
inline const glm::dmat3 quarter_turn_about_x(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);

/// Turns Gaussians from one choice of axis directions to another: every axis is kept (+1) or
/// flipped (-1). Its own inverse. GaussianCloud has the axes of COLMAP captures: right, down,
/// front.
class AxisFlip {
 public:
  explicit AxisFlip(const glm::vec3& signs) : signs_(signs) {
    assert(glm::abs(signs) == glm::vec3(1.0f));
    const float x = signs.x, y = signs.y, z = signs.z;
    // A basis function is a polynomial in the direction. Its sign is the product of the signs of
    // the axes that it has in odd powers. Order as in the original 3DGS.
    sh_signs_ = {1,     y,         z, x,                // y, z, x
                 x * y, y * z,     1, x * z, 1,         // xy, yz, zz, xz, xx - yy
                 y,     x * y * z, y, z,     x, z, x};  // yxx, xyz, yzz, zzz, xzz, zxx, xxx
  }

  [[nodiscard]] glm::vec3 mean(const glm::vec3& m) const { return signs_ * m; }
  /// F R F is a rotation again, whatever the handedness of F.
  [[nodiscard]] glm::quat rotation(const glm::quat& q) const {
    return {q.w, q.x * signs_.y * signs_.z, q.y * signs_.x * signs_.z, q.z * signs_.x * signs_.y};
  }
  /// Sign of basis function `k`.
  [[nodiscard]] float sh(std::size_t k) const {
    assert(k < sh_signs_.size());
    return sh_signs_[k];
  }

 private:
  glm::vec3 signs_;
  std::array<float, sh_coefficient_count(max_sh_degree)> sh_signs_{};
};

}  // namespace catgs
