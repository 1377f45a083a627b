#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <glm/vec3.hpp>

namespace catgs {

/// Calls take(direction, weight) for points of a sphere whose weighted sum is the integral of every
/// polynomial up to degree 7: Gauss-Legendre along z, even steps around it.
template <class Take>
void for_directions(const Take& take) {
  constexpr std::array<double, 4> heights = {-0.8611363115940526, -0.3399810435848563,
                                             0.3399810435848563, 0.8611363115940526};
  constexpr std::array<double, 4> weights = {0.3478548451374538, 0.6521451548625461,
                                             0.6521451548625461, 0.3478548451374538};
  constexpr int steps = 8;
  constexpr double step = 2.0 * std::numbers::pi / steps;
  for (std::size_t ring = 0; ring < heights.size(); ++ring)
    for (int k = 0; k < steps; ++k) {
      const double radius = std::sqrt(1.0 - heights[ring] * heights[ring]);
      take(glm::dvec3(radius * std::cos(k * step), radius * std::sin(k * step), heights[ring]),
           weights[ring] * step);
    }
}

}  // namespace catgs
