#pragma once

#include <algorithm>
#include <cmath>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include "render_core/math/constants.h"

namespace catgs {

// Scene files store what training optimises: logits, logarithms, colours as the coefficient of the
// constant basis function. These are the maps between that and GaussianCloud's plain values.

inline constexpr auto sh_c0 = static_cast<float>(sh_basis_0);

/// The largest float below 1: GaussianCloud's opacities are in (0, 1), and logits over 17 or a byte
/// of 255 round to 1.
inline constexpr float max_opacity = 1.0f - 0x1p-24f;

inline float opacity_from_logit(float logit) {
  return std::min(1.0f / (1.0f + std::exp(-logit)), max_opacity);
}
inline float opacity_from_byte(unsigned char byte) {
  return std::min(static_cast<float>(byte) / 255.0f, max_opacity);
}

/// Inverse of opacity_from_logit; `opacity` is kept off the ends so that the result is finite.
inline float logit(float opacity) {
  const double v = std::clamp(static_cast<double>(opacity), 1e-9, 1.0 - 1e-9);
  return static_cast<float>(std::log(v / (1.0 - v)));
}

inline glm::vec3 exp(const glm::vec3& v) { return {std::exp(v.x), std::exp(v.y), std::exp(v.z)}; }
inline glm::vec3 log(const glm::vec3& v) { return {std::log(v.x), std::log(v.y), std::log(v.z)}; }

/// `value` rounded to the nearest of 0…255, for writers.
inline unsigned char to_byte(float value) {
  return static_cast<unsigned char>(std::lround(std::clamp(value, 0.0f, 255.0f)));
}

/// SH coefficient of a colour component in [0, 1], constant term only.
inline float sh_from_colour(float colour) { return (colour - 0.5f) / sh_c0; }
inline float colour_from_sh(float sh) { return 0.5f + sh_c0 * sh; }

/// Unit quaternion. A quaternion that is unit up to rounding stays bit for bit; zero and non-finite
/// ones are returned unchanged, for `sanitize` to judge.
inline glm::quat unit(const glm::quat& q) {
  const float squared = glm::dot(q, q);
  if (std::abs(squared - 1.0f) < 1e-6f || !(squared > 0.0f) || !std::isfinite(squared)) return q;
  return q / std::sqrt(squared);
}

}  // namespace catgs
