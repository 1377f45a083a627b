#include "render_core/scene/formats/sog_image.h"

#include <algorithm>
#include <array>
#include <span>

#include <webp/decode.h>

#include "render_core/base/error.h"

namespace catgs {

namespace {

constexpr std::uint64_t max_file_bytes = std::uint64_t{1} << 31;

SogImageSize parse_size(const ByteSource& file, std::span<const std::byte> start) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(reinterpret_cast<const std::uint8_t*>(start.data()), start.size(),
                      &features) != VP8_STATUS_OK)
    throw InputError(file.name(), "byte 0", "is not a WebP image");
  constexpr int lossless = 2;
  if (features.format != lossless || features.has_animation)
    throw InputError(file.name(), "byte 0", "is not a lossless WebP image",
                     "SOG keeps exact bytes in its images; do not convert them");
  return {static_cast<std::uint32_t>(features.width), static_cast<std::uint32_t>(features.height)};
}

}  // namespace

SogImageSize sog_image_size(const ByteSource& file) {
  std::array<std::byte, 256> start;
  const auto got = std::span(start).first(std::min<std::uint64_t>(start.size(), file.size()));
  file.read(0, got);
  return parse_size(file, got);
}

SogImage read_sog_image(const ByteSource& file) {
  const std::vector<std::byte> bytes = file.read_all(max_file_bytes);
  const SogImageSize size = parse_size(file, bytes);
  SogImage image{size.width, size.height, std::vector<std::uint8_t>(4 * size.texels())};
  if (!WebPDecodeRGBAInto(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(),
                          image.rgba.data(), image.rgba.size(), static_cast<int>(4 * size.width)))
    throw InputError(file.name(), "", "the image is damaged or cut off");
  return image;
}

}  // namespace catgs
