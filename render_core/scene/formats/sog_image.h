#pragma once

#include <cstdint>
#include <vector>

#include "render_core/scene/formats/byte_source.h"

namespace catgs {

/// A decoded lossless WebP or PNG image, 4 bytes (R, G, B, A) per texel, row by row.
struct SogImage {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> rgba;

  [[nodiscard]] const std::uint8_t* texel(std::size_t i) const { return rgba.data() + 4 * i; }
};

struct SogImageSize {
  std::uint32_t width = 0, height = 0;
  [[nodiscard]] std::uint64_t texels() const { return std::uint64_t{width} * height; }
};

/// Size of the image from its header. Throws InputError when it is neither a lossless WebP
/// nor a PNG of 8 bits a channel.
SogImageSize sog_image_size(const ByteSource& file);

/// Throws InputError.
SogImage read_sog_image(const ByteSource& file);

}  // namespace catgs
