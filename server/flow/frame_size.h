#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/vec2.hpp>

namespace catgs {

/// The frame size for a request: scaled down to at most `max_pixels` in the same aspect ratio.
/// Sides are even (4:2:0) and within 16…8192.
inline glm::ivec2 frame_size(glm::ivec2 requested_px, int max_pixels) {
  const double pixels = static_cast<double>(requested_px.x) * requested_px.y;
  const double scale = std::min(1.0, std::sqrt(max_pixels / std::max(1.0, pixels)));
  const auto side = [scale](int request) {
    const int scaled = static_cast<int>(request * scale);
    return std::clamp(scaled - scaled % 2, 16, 8192);
  };
  return {side(requested_px.x), side(requested_px.y)};
}

/// Scales both sides by `scale`, with the rules of frame_size().
inline glm::ivec2 scaled_size(glm::ivec2 size_px, double scale) {
  return frame_size({static_cast<int>(std::lround(size_px.x * scale)),
                     static_cast<int>(std::lround(size_px.y * scale))},
                    std::numeric_limits<int>::max());
}

}  // namespace catgs
