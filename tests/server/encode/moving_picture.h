#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/renderer.h"

namespace catgs::test {

/// An i420 picture in memory of its own.
struct Picture {
  explicit Picture(glm::ivec2 size) : size_px(size) {
    const auto luma = static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y);
    planes = {std::vector<std::uint8_t>(luma, 16), std::vector<std::uint8_t>(luma / 4, 128),
              std::vector<std::uint8_t>(luma / 4, 128)};
  }

  [[nodiscard]] FrameView view() {
    FrameView frame;
    frame.format = PixelFormat::i420;
    frame.size_px = size_px;
    for (std::size_t i = 0; i < planes.size(); ++i) {
      const auto width = static_cast<std::size_t>(i == 0 ? size_px.x : size_px.x / 2);
      frame.planes[i] = {reinterpret_cast<std::byte*>(planes[i].data()), width};
    }
    return frame;
  }

  glm::ivec2 size_px;
  std::array<std::vector<std::uint8_t>, 3> planes;
};

/// Smooth structure and fine texture that pan by (3, 1) px a frame: like a rendered view that
/// turns. In limited range.
inline Picture moving_picture(glm::ivec2 size_px, int time) {
  Picture picture(size_px);
  const auto wave = [](double phase, double amplitude) { return amplitude * std::sin(phase); };
  for (std::size_t plane = 0; plane < 3; ++plane) {
    const int step = plane == 0 ? 1 : 2;
    const double middle = plane == 0 ? 126 : 128;
    const double scale = plane == 0 ? 1.0 : 0.5;
    auto* out = picture.planes[plane].data();
    for (int y = 0; y < size_px.y; y += step) {
      for (int x = 0; x < size_px.x; x += step) {
        const double u = x + 3 * time;
        const double v = y + time;
        const double value = wave(u * 0.021 + v * 0.013 + static_cast<double>(plane), 60) +
                             wave(u * 0.11 - v * 0.17, 25) + wave(u * 0.71 + v * 0.53, 10);
        *out++ = static_cast<std::uint8_t>(middle + scale * value);
      }
    }
  }
  return picture;
}

/// Peak signal-to-noise ratio in dB of two planes of equal length; infinite for equal ones.
inline double psnr(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = static_cast<double>(a[i]) - b[i];
    sum += difference * difference;
  }
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.size()) / sum);
}

}  // namespace catgs::test
