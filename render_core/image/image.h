#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>

namespace catgs {

/// An RGB picture in host memory, display-referred, values in [0, 1].
struct Image {
  glm::ivec2 size_px{0};
  std::vector<float> rgb;  // size.x * size.y * 3, row by row from the top

  [[nodiscard]] std::size_t pixels() const { return rgb.size() / 3; }
  [[nodiscard]] const float* row(int y) const {
    return rgb.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(size_px.x) * 3;
  }
};

/// A channel's value in [0, 1] as one of 8 bits, rounded to nearest.
inline std::uint8_t byte_of(float value) {
  return static_cast<std::uint8_t>(std::lround(255.0f * std::clamp(value, 0.0f, 1.0f)));
}

}  // namespace catgs
