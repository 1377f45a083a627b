#include "server/encode/test_picture.h"

#include <cmath>
#include <cstddef>
#include <numbers>

namespace catgs {

I420Picture::I420Picture(glm::ivec2 size) : size_px(size) {
  const auto luma = static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y);
  planes = {std::vector<std::uint8_t>(luma, 16), std::vector<std::uint8_t>(luma / 4, 128),
            std::vector<std::uint8_t>(luma / 4, 128)};
}

FrameView I420Picture::view() {
  FrameView frame;
  frame.format = PixelFormat::i420;
  frame.size_px = size_px;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const auto width = static_cast<std::size_t>(i == 0 ? size_px.x : size_px.x / 2);
    frame.planes[i] = {reinterpret_cast<std::byte*>(planes[i].data()), width};
  }
  return frame;
}

I420Picture moving_picture(glm::ivec2 size_px, int time) {
  static const std::array<double, 1024> sine = [] {  // of turns / 1024
    std::array<double, 1024> table{};
    for (std::size_t i = 0; i < table.size(); ++i) {
      table[i] = std::sin(2 * std::numbers::pi * static_cast<double>(i) / 1024);
    }
    return table;
  }();
  const auto wave = [](int phase) { return sine[static_cast<unsigned>(phase) % sine.size()]; };
  I420Picture picture(size_px);
  for (int plane = 0; plane < 3; ++plane) {
    const int step = plane == 0 ? 1 : 2;
    const double scale = plane == 0 ? 1.0 : 0.5;
    auto* out = picture.planes[plane].data();
    for (int y = 0; y < size_px.y; y += step) {
      for (int x = 0; x < size_px.x; x += step) {
        const int u = x + 3 * time;
        const int v = y + time;
        const double value = 60 * wave(3 * u + 2 * v + 160 * plane) + 25 * wave(18 * u - 28 * v) +
                             10 * wave(116 * u + 86 * v);
        *out++ = static_cast<std::uint8_t>(128 + scale * value);
      }
    }
  }
  return picture;
}

double psnr(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = static_cast<double>(a[i]) - b[i];
    sum += difference * difference;
  }
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.size()) / sum);
}

}  // namespace catgs
