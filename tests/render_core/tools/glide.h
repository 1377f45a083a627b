#pragma once

#include <cstddef>
#include <cstdint>

#include <glm/vec3.hpp>

#include "render_core/motion/trajectory.h"

namespace catgs::test {

/// A camera that glides sideways at 0.48 units a second, 120 samples a second.
inline Trajectory glide(std::size_t frames) {
  Trajectory path;
  for (std::size_t i = 0; i < frames; ++i) {
    const auto time = static_cast<std::int64_t>(i) * 1'000'000 / 120;
    path.push_back({time, {glm::vec3(0.004f * static_cast<float>(i), 0, 0), {1, 0, 0, 0}}});
  }
  return path;
}

}  // namespace catgs::test
