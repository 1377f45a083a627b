#pragma once

#include <cstdint>
#include <random>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace catgs::test {

/// Random numbers of tests that try many cases.
class RandomSource {
 public:
  explicit RandomSource(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  /// Unit length, every direction as likely.
  glm::dvec3 direction() {
    std::normal_distribution<double> normal;
    return glm::normalize(glm::dvec3(normal(engine_), normal(engine_), normal(engine_)));
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace catgs::test
