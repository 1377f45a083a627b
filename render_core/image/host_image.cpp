#include "render_core/image/host_image.h"

#include <cassert>

namespace catgs {

ImagePlanes ImagePlanes::part(int left_px, glm::ivec2 size_px) const {
  assert(left_px >= 0 && left_px + size_px.x <= size_px_.x && size_px.y <= size_px_.y);
  assert(format_ == PixelFormat::rgb_f32 || (left_px % 2 == 0 && size_px.x % 2 == 0));
  ImagePlanes part = *this;
  part.size_px_ = size_px;
  const auto left = static_cast<std::size_t>(left_px);
  if (format_ == PixelFormat::rgb_f32) {
    part.planes_[0].data += left * 3 * sizeof(float);
  } else {
    part.planes_[0].data += left;
    for (int plane = 1; plane < 3; ++plane) part.planes_[plane].data += left / 2;
  }
  return part;
}

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
