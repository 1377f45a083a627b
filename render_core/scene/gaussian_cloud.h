#pragma once

#include <cassert>
#include <cstddef>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include "render_core/scene/splat_model.h"

namespace catgs {

/// Spherical-harmonics coefficients per colour channel for a degree in 0…3: (degree + 1)^2.
constexpr int sh_coefficient_count(int degree) { return (degree + 1) * (degree + 1); }
inline constexpr int max_sh_degree = 3;
/// Degree of coefficient k.
constexpr int sh_degree_of(int k) { return k < 1 ? 0 : k < 4 ? 1 : k < 9 ? 2 : 3; }

/// A 3D Gaussian Splatting scene as a structure of arrays, normalised once by the readers:
/// whatever the file stored (logarithms, logits, quantised values), here it is plain values.
///
/// N = size(); all arrays have N entries but `sh`, which has N * K with K =
/// sh_coefficient_count(sh_degree). Invariants (established by `sanitize`): every value finite,
/// `rotation` unit length, `scale` > 0, `opacity` in (0, 1).
struct GaussianCloud {
  SplatModel model = SplatModel::standard;
  int sh_degree = 0;
  std::vector<glm::vec3> mean;      // world units
  std::vector<glm::quat> rotation;  // Gaussian axes to world axes; memory order x, y, z, w
  std::vector<glm::vec3> scale;     // standard deviation along each Gaussian axis, world units
  std::vector<float> opacity;       // peak alpha
  // Coefficient-major: sh[i * K + k] is the RGB triple of basis function k of Gaussian i. Basis
  // order and signs are those of the original 3DGS; colour = 0.5 + sum_k basis_k * sh_k.
  std::vector<glm::vec3> sh;

  [[nodiscard]] std::size_t size() const { return mean.size(); }
  [[nodiscard]] bool empty() const { return mean.empty(); }
  [[nodiscard]] bool sizes_agree() const {
    return rotation.size() == size() && scale.size() == size() && opacity.size() == size() &&
           sh.size() == size() * sh_count();
  }
  [[nodiscard]] int sh_count() const { return sh_coefficient_count(sh_degree); }
  [[nodiscard]] const glm::vec3* sh_of(std::size_t i) const { return sh.data() + i * sh_count(); }

  /// Bytes held by N Gaussians of this SH degree.
  static constexpr std::size_t bytes(std::size_t count, int sh_degree) {
    return count * (sizeof(glm::vec3) * 2 + sizeof(glm::quat) + sizeof(float) +
                    sizeof(glm::vec3) * sh_coefficient_count(sh_degree));
  }
  [[nodiscard]] std::size_t bytes() const { return bytes(size(), sh_degree); }

  /// Sets the size of every array; new entries are value-initialised.
  void resize(std::size_t count, int degree) {
    assert(degree >= 0 && degree <= max_sh_degree);
    sh_degree = degree;
    mean.resize(count);
    rotation.resize(count);
    scale.resize(count);
    opacity.resize(count);
    sh.resize(count * sh_coefficient_count(degree));
  }
};

}  // namespace catgs
