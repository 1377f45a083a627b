#include "render_core/scene/formats/sog_image.h"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <span>
#include <string_view>

#include <fmt/format.h>
#include <png.h>
#include <webp/decode.h>
#include <webp/encode.h>

#include "render_core/base/error.h"

namespace catgs {

namespace {

constexpr std::uint64_t max_file_bytes = std::uint64_t{1} << 31;

constexpr std::string_view png_signature = "\x89PNG\r\n\x1a\n";
// The signature is followed by the chunk IHDR: its size, its name, width, height, bits, colour
// type.
constexpr std::size_t png_width_at = 16, png_height_at = 20, png_bits_at = 24, png_start = 26;

bool is_png(std::span<const std::byte> start) {
  return start.size() >= png_start && std::ranges::equal(start.first(png_signature.size()),
                                                         std::as_bytes(std::span(png_signature)));
}

SogImageSize parse_png_size(const ByteSource& file, std::span<const std::byte> start) {
  const auto byte = [&](std::size_t at) { return std::to_integer<std::uint32_t>(start[at]); };
  const auto word = [&](std::size_t at) {
    return byte(at) << 24 | byte(at + 1) << 16 | byte(at + 2) << 8 | byte(at + 3);
  };
  const std::uint32_t colours = byte(png_bits_at + 1);
  if (byte(png_bits_at) != 8 ||
      (colours != PNG_COLOR_TYPE_RGB && colours != PNG_COLOR_TYPE_RGB_ALPHA))
    throw InputError(file.name(), fmt::format("byte {}", png_bits_at),
                     "is not a PNG of 8 bits a channel, in RGB or RGBA");
  const SogImageSize size{word(png_width_at), word(png_height_at)};
  if (size.width > WEBP_MAX_DIMENSION || size.height > WEBP_MAX_DIMENSION)
    throw InputError(file.name(), fmt::format("byte {}", png_width_at),
                     fmt::format("{}x{} texels, at most {} a side", size.width, size.height,
                                 WEBP_MAX_DIMENSION));
  return size;
}

SogImageSize parse_webp_size(const ByteSource& file, std::span<const std::byte> start) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(reinterpret_cast<const std::uint8_t*>(start.data()), start.size(),
                      &features) != VP8_STATUS_OK)
    throw InputError(file.name(), "byte 0", "is neither a WebP nor a PNG image");
  constexpr int lossless = 2;
  if (features.format != lossless || features.has_animation)
    throw InputError(file.name(), "byte 0", "is not a lossless WebP image",
                     "SOG keeps exact bytes in its images; do not convert them");
  return {static_cast<std::uint32_t>(features.width), static_cast<std::uint32_t>(features.height)};
}

SogImageSize parse_size(const ByteSource& file, std::span<const std::byte> start) {
  return is_png(start) ? parse_png_size(file, start) : parse_webp_size(file, start);
}

/// libpng with the bytes that are left to it. It converts no colours: they are numbers here.
struct PngDecoder {
  explicit PngDecoder(std::span<const std::byte> bytes) : left(bytes) {
    png = png_create_read_struct(
        PNG_LIBPNG_VER_STRING, nullptr,
        [](png_structp failed, png_const_charp) { png_longjmp(failed, 1); },
        [](png_structp, png_const_charp) {});
    if (png) info = png_create_info_struct(png);
  }
  ~PngDecoder() { png_destroy_read_struct(&png, &info, nullptr); }
  PngDecoder(const PngDecoder&) = delete;
  PngDecoder& operator=(const PngDecoder&) = delete;

  std::span<const std::byte> left;
  png_structp png = nullptr;
  png_infop info = nullptr;
};

void read_png_bytes(png_structp png, png_bytep to, std::size_t count) {
  auto& left = static_cast<PngDecoder*>(png_get_io_ptr(png))->left;
  if (count > left.size()) png_error(png, "cut off");
  std::ranges::copy(left.first(count), reinterpret_cast<std::byte*>(to));
  left = left.subspan(count);
}

/// Errors of libpng come back as a jump, so that nothing here has a destructor.
[[gnu::noinline]] bool decode_png(PngDecoder& decoder, std::span<png_bytep> rows) {
  png_structp png = decoder.png;
  if (!decoder.info || setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_read_fn(png, &decoder, read_png_bytes);
  png_read_info(png, decoder.info);
  png_set_add_alpha(png, 0xff, PNG_FILLER_AFTER);
  png_set_interlace_handling(png);
  png_read_update_info(png, decoder.info);
  if (png_get_image_height(png, decoder.info) != rows.size() ||
      png_get_rowbytes(png, decoder.info) !=
          4 * std::size_t{png_get_image_width(png, decoder.info)})
    return false;
  png_read_image(png, rows.data());
  return true;
}

bool decode(std::span<const std::byte> bytes, SogImage& image) {
  if (!is_png(bytes))
    return WebPDecodeRGBAInto(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(),
                              image.rgba.data(), image.rgba.size(),
                              static_cast<int>(4 * image.width)) != nullptr;
  std::vector<png_bytep> rows(image.height);
  for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = image.rgba.data() + 4 * y * image.width;
  PngDecoder decoder(bytes);
  return decode_png(decoder, rows);
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
  if (!decode(bytes, image)) throw InputError(file.name(), "", "the image is damaged or cut off");
  return image;
}

}  // namespace catgs
