#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <random>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs::test {

/// Opaque balls of standard deviation `size` at what `position` samples.
inline GaussianCloud sampled_surface(std::size_t count, float size,
                                     const std::function<glm::vec3()>& position) {
  GaussianCloud cloud;
  cloud.resize(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    cloud.mean[i] = position();
    cloud.scale[i] = glm::vec3(size);
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.opacity[i] = 0.9f;
  }
  return cloud;
}

/// Filled: a hollow one is a room.
inline GaussianCloud ball(float radius) {
  std::mt19937 random(1);
  return sampled_surface(20000, 0.02f * radius, [&] {
    std::normal_distribution<float> normal;
    std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
    const glm::vec3 direction(normal(random), normal(random), normal(random));
    return radius * std::cbrt(uniform(random)) * glm::normalize(direction);
  });
}

/// The walls, floor and ceiling of a room 8 x 3 x 6 around the origin.
inline GaussianCloud room() {
  std::mt19937 random(2);
  return sampled_surface(60000, 0.05f, [&] {
    std::uniform_real_distribution<float> uniform(-1.0f, 1.0f);
    glm::vec3 p(uniform(random), uniform(random), uniform(random));
    const int face = std::uniform_int_distribution<int>(0, 2)(random);
    p[face] = p[face] < 0 ? -1.0f : 1.0f;
    return p * glm::vec3(4.0f, 1.5f, 3.0f);
  });
}

}  // namespace catgs::test
