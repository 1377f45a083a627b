#pragma once

#include <algorithm>
#include <cmath>

#include <glm/vec3.hpp>

#include "render_core/math/projection-inl.h"

namespace catgs {

/// Covariance of a Gaussian: the upper triangle. Also a sum of covariances.
template <class T>
struct Covariance {
  T xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;

  void add(T weight, const Covariance& c) {
    xx += weight * c.xx;
    xy += weight * c.xy;
    xz += weight * c.xz;
    yy += weight * c.yy;
    yz += weight * c.yz;
    zz += weight * c.zz;
  }
  [[nodiscard]] T trace() const { return xx + yy + zz; }
  /// RMS over all directions of the projected area, but for a factor of pi.
  [[nodiscard]] T area() const {
    const T minors =
        xx * yy - xy * xy + (xx * zz - xz * xz) + (yy * zz - yz * yz);  // tr(adj Sigma)
    return std::sqrt(std::max(minors, T(0)) / T(3));
  }
};

/// d d^T.
template <class T>
Covariance<T> outer(const glm::vec<3, T>& d) {
  return {d.x * d.x, d.x * d.y, d.x * d.z, d.y * d.y, d.y * d.z, d.z * d.z};
}

template <class T>
Covariance<T> covariance_of(const math::CovarianceFactor<T>& l) {
  return {l.xx * l.xx,
          l.xx * l.yx,
          l.xx * l.zx,
          l.yx * l.yx + l.yy * l.yy,
          l.yx * l.zx + l.yy * l.zy,
          l.zx * l.zx + l.zy * l.zy + l.zz * l.zz};
}

/// Cholesky factor. Sums of covariances are at least as round as their parts, so forming them costs
/// no digits that count for pictures.
inline math::CovarianceFactor<double> factor_of(const Covariance<double>& c) {
  const auto root = [](double v) { return std::sqrt(std::max(v, 0.0)); };
  const auto over = [](double v, double pivot) { return pivot > 0.0 ? v / pivot : 0.0; };
  math::CovarianceFactor<double> l{};
  l.xx = root(c.xx);
  l.yx = over(c.xy, l.xx);
  l.zx = over(c.xz, l.xx);
  l.yy = root(c.yy - l.yx * l.yx);
  l.zy = over(c.yz - l.yx * l.zx, l.yy);
  l.zz = root(c.zz - l.zx * l.zx - l.zy * l.zy);
  return l;
}

/// How far a full step of colour counts in the cost of joining two Gaussians, in mean sizes; see
/// tree/merge_nodes.h. On the city of 1 M, 2 loses 1.3 dB at the same number of Gaussians, and 24
/// gains nothing.
inline constexpr float colour_reach = 12.0f;

}  // namespace catgs
