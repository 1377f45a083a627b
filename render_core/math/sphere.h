#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include <glm/vec3.hpp>

namespace catgs {

/// Unit vectors that are spread evenly over the sphere: a Fibonacci lattice.
template <std::size_t count>
std::array<glm::vec3, count> sphere_directions() {
  constexpr float golden_angle = 2.3999632f;
  std::array<glm::vec3, count> directions;
  for (std::size_t d = 0; d < count; ++d) {
    const float y = static_cast<float>(2 * d + 1) / count - 1.0f;
    const float ring = std::sqrt(1.0f - y * y), angle = golden_angle * static_cast<float>(d);
    directions[d] = {ring * std::cos(angle), y, ring * std::sin(angle)};
  }
  return directions;
}

}  // namespace catgs
