#pragma once

#include <cassert>
#include <vector>

#include "render_core/frame/renderer.h"

namespace catgs {

/// Planes of an image in host memory, or of a part of it. The memory belongs to another.
class ImagePlanes {
 public:
  [[nodiscard]] PixelFormat format() const { return format_; }
  [[nodiscard]] glm::ivec2 size_px() const { return size_px_; }
  [[nodiscard]] const std::array<Plane, 3>& planes() const { return planes_; }

  /// rgb_f32: row `y`, 3 floats a pixel.
  [[nodiscard]] float* rgb_row(int y) const {
    assert(format_ == PixelFormat::rgb_f32 && y >= 0 && y < size_px_.y);
    return reinterpret_cast<float*>(planes_[0].data + planes_[0].stride_bytes * y);
  }
  /// i420: row `y` of a plane; planes 1 and 2 have half the rows and columns.
  [[nodiscard]] std::uint8_t* byte_row(int plane, int y) const {
    assert(format_ == PixelFormat::i420 && plane >= 0 && plane < 3);
    assert(y >= 0 && y < (plane == 0 ? size_px_.y : size_px_.y / 2));
    return reinterpret_cast<std::uint8_t*>(planes_[plane].data + planes_[plane].stride_bytes * y);
  }

  /// The part of `size_px` columns and rows from column `left_px` on. i420 needs even numbers.
  [[nodiscard]] ImagePlanes part(int left_px, glm::ivec2 size_px) const;

 protected:
  PixelFormat format_ = PixelFormat::rgb_f32;
  glm::ivec2 size_px_{0};
  std::array<Plane, 3> planes_{};
};

/// The output image of a View in host memory. Planes are tightly packed; memory is kept when the
/// image shrinks.
class HostImage : public ImagePlanes {
 public:
  /// Planes of an image of this size; contents are unspecified. i420 needs even sides.
  void resize(PixelFormat format, glm::ivec2 size_px);

  [[nodiscard]] std::size_t memory_bytes() const { return bytes_.capacity(); }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace catgs
