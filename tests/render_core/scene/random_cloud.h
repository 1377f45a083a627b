#pragma once

#include <cmath>
#include <cstddef>
#include <random>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs::test {

/// Values as in a trained capture of about 10 units: log-normal scales, every opacity above 1/255.
inline GaussianCloud random_cloud(std::size_t count, int sh_degree, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
  GaussianCloud cloud;
  cloud.resize(count, sh_degree);
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) {
      cloud.mean[i][k] = 3.0f * normal(random);
      cloud.scale[i][k] = std::exp(-4.0f + normal(random));
    }
    cloud.rotation[i] =
        glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)));
    cloud.opacity[i] = 0.01f + 0.98f * uniform(random);
  }
  for (std::size_t i = 0; i < cloud.sh.size(); ++i) {
    const bool constant = i % static_cast<std::size_t>(cloud.sh_count()) == 0;
    for (int k = 0; k < 3; ++k)
      cloud.sh[i][k] = constant ? 3.0f * (uniform(random) - 0.5f) : 0.2f * normal(random);
  }
  return cloud;
}

}  // namespace catgs::test
