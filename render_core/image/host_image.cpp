#include "render_core/image/host_image.h"

#include <cassert>

namespace catgs {

void HostImage::resize(PixelFormat format, glm::ivec2 size_px) {
  assert(size_px.x > 0 && size_px.y > 0);
  assert(format == PixelFormat::rgb_f32 || (size_px.x % 2 == 0 && size_px.y % 2 == 0));
  const auto width = static_cast<std::size_t>(size_px.x);
  const auto height = static_cast<std::size_t>(size_px.y);
  const std::size_t luma = width * height;
  const bool rgb = format == PixelFormat::rgb_f32;
  const std::size_t total = rgb ? luma * 3 * sizeof(float) : luma + luma / 2;
  if (bytes_.size() < total) bytes_.resize(total);
  format_ = format;
  size_px_ = size_px;
  std::byte* data = bytes_.data();
  if (rgb) {
    planes_ = {Plane{data, width * 3 * sizeof(float)}, Plane{}, Plane{}};
  } else {
    planes_ = {Plane{data, width}, Plane{data + luma, width / 2},
               Plane{data + luma + luma / 4, width / 2}};
  }
}

}  // namespace catgs
