#include "render_core/scene/transform.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include "render_core/math/spherical_harmonics-inl.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/directions.h"

namespace catgs {
namespace {

/// a = axes * diag(lengths) * transpose(right), with orthogonal `axes` and `right`.
struct SingularValues {
  glm::dmat3 axes, right;
  glm::dvec3 lengths;
};

/// One-sided Jacobi (Hestenes 1958): turns pairs of columns until all are perpendicular. Unlike the
/// eigenvectors of a covariance, it keeps the digits of very flat Gaussians. No column may be 0.
SingularValues singular_values(glm::dmat3 a) {
  constexpr int most_sweeps = 30;  // five suffice
  constexpr std::array<std::pair<int, int>, 3> pairs = {{{0, 1}, {0, 2}, {1, 2}}};
  SingularValues result;
  result.right = glm::dmat3(1.0);
  bool turned = true;
  for (int sweep = 0; sweep < most_sweeps && turned; ++sweep) {
    turned = false;
    for (const auto& [p, q] : pairs) {
      const double pp = glm::dot(a[p], a[p]), qq = glm::dot(a[q], a[q]), pq = glm::dot(a[p], a[q]);
      if (!(std::abs(pq) > 1e-15 * std::sqrt(pp) * std::sqrt(qq))) continue;
      turned = true;
      const double zeta = (qq - pp) / (2.0 * pq);
      const double tangent = std::copysign(1.0, zeta) / (std::abs(zeta) + std::hypot(1.0, zeta));
      const double cosine = 1.0 / std::hypot(1.0, tangent), sine = cosine * tangent;
      for (glm::dmat3* m : {&a, &result.right}) {
        const glm::dvec3 column = (*m)[p];
        (*m)[p] = cosine * column - sine * (*m)[q];
        (*m)[q] = sine * column + cosine * (*m)[q];
      }
    }
  }
  for (int k = 0; k < 3; ++k) {
    result.lengths[k] = glm::length(a[k]);
    result.axes[k] = a[k] / result.lengths[k];
  }
  return result;
}

bool is_near(const glm::dmat3& a, const glm::dmat3& b, double tolerance) {
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r)
      if (!(std::abs(a[c][r] - b[c][r]) <= tolerance)) return false;
  return true;
}

}  // namespace

bool AffineMap::usable() const {
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r)
      if (!std::isfinite(linear[c][r])) return false;
  for (int c = 0; c < 3; ++c)
    if (!std::isfinite(offset[c]) || !(glm::length(linear[c]) > 1e-30)) return false;
  const glm::dmat3 unit_columns(glm::normalize(linear[0]), glm::normalize(linear[1]),
                                glm::normalize(linear[2]));
  return std::abs(glm::determinant(unit_columns)) > 1e-9;
}

AffineMap operator*(const AffineMap& second, const AffineMap& first) {
  return {second.linear * first.linear, second(first.offset)};
}

CloudTransform::CloudTransform(const AffineMap& map) : map_(map) {
  assert(map.usable());
  const SingularValues singular = singular_values(map.linear);
  const double largest = std::max({singular.lengths.x, singular.lengths.y, singular.lengths.z});
  const double mean = (singular.lengths.x + singular.lengths.y + singular.lengths.z) / 3.0;
  turn_ = singular.axes * glm::transpose(singular.right);
  if (is_near(turn_, glm::dmat3(1.0), 1e-12)) turn_ = glm::dmat3(1.0);
  if (is_near(map.linear / largest, turn_, 1e-6)) factor_ = mean;
  // A Gaussian mirrored at its middle is the same one, so a reflection of shapes is a rotation too.
  turn_quat_ = glm::quat(glm::quat_cast(glm::determinant(turn_) < 0.0 ? -turn_ : turn_));
  turns_ = turn_ != glm::dmat3(1.0);
  if (!turns_) return;
  // The turned function at d is the old one at transpose(turn) d. Its coefficients are its scalar
  // products with the basis, which is orthonormal.
  std::array<std::array<double, 7>, 16> sums{};
  for_directions([&](const glm::dvec3& d, double weight) {
    const glm::dvec3 back = glm::transpose(turn_) * d;
    double here[16], before[16];
    math::sh_basis<double>({d.x, d.y, d.z}, max_sh_degree, here);
    math::sh_basis<double>({back.x, back.y, back.z}, max_sh_degree, before);
    for (int to = 0; to < 16; ++to) {
      const int degree = sh_degree_of(to), first = degree * degree;
      for (int k = 0; k <= 2 * degree; ++k)
        sums[static_cast<std::size_t>(to)][static_cast<std::size_t>(k)] +=
            weight * here[to] * before[first + k];
    }
  });
  for (std::size_t to = 0; to < sums.size(); ++to)
    for (std::size_t k = 0; k < 7; ++k)  // exact zeros where axes are but exchanged
      sh_[to][k] = std::abs(sums[to][k]) < 1e-12 ? 0.0f : static_cast<float>(sums[to][k]);
}

void CloudTransform::apply_to_shape(glm::quat& rotation, glm::vec3& scale) const {
  const float squared = glm::dot(rotation, rotation);
  if (!(squared > 0.0f) || !std::isfinite(squared)) return;  // sanitize() judges it
  if (factor_ > 0.0) {
    scale *= static_cast<float>(factor_);
    rotation = turn_quat_ * unit(rotation);
    return;
  }
  const glm::dmat3 before = glm::mat3_cast(glm::normalize(glm::dquat(rotation)));
  const glm::dvec3 lengths = glm::max(glm::dvec3(scale), 1e-30);
  SingularValues singular =
      singular_values(map_.linear * glm::dmat3(before[0] * lengths.x, before[1] * lengths.y,
                                               before[2] * lengths.z));
  if (glm::determinant(singular.axes) < 0.0) singular.axes = -singular.axes;
  scale = glm::vec3(singular.lengths);
  rotation = unit(glm::quat(glm::quat_cast(singular.axes)));
}

void flatten(GaussianCloud& cloud) {
  constexpr float thickness = 1e-3f;  // of the smaller radius
  for (glm::vec3& scale : cloud.scale) scale.z = thickness * std::min(scale.x, scale.y);
}

void CloudTransform::apply(GaussianCloud& cloud, std::size_t i) const {
  cloud.mean[i] = glm::vec3(map_(glm::dvec3(cloud.mean[i])));
  apply_to_shape(cloud.rotation[i], cloud.scale[i]);
  if (!turns_) return;
  glm::vec3* sh = cloud.sh.data() + i * static_cast<std::size_t>(cloud.sh_count());
  std::array<glm::vec3, 16> before;
  std::copy_n(sh, cloud.sh_count(), before.begin());
  for (int to = 1; to < cloud.sh_count(); ++to) {
    const int degree = sh_degree_of(to), first = degree * degree;
    glm::vec3 sum(0.0f);
    for (int k = 0; k <= 2 * degree; ++k)
      sum += sh_[static_cast<std::size_t>(to)][static_cast<std::size_t>(k)] *
             before[static_cast<std::size_t>(first + k)];
    sh[to] = sum;
  }
}

}  // namespace catgs
