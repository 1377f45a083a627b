#include "render_core/image/png.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>
#include <png.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

/// libpng's simplified interface, freed whatever happens.
struct PngImage : png_image {
  PngImage() : png_image{} { version = PNG_IMAGE_VERSION; }
  ~PngImage() { png_image_free(this); }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
};

void write_bytes(const std::filesystem::path& path, glm::ivec2 size_px, png_uint_32 format,
                 const std::uint8_t* bytes) {
  PngImage png;
  png.width = static_cast<png_uint_32>(size_px.x);
  png.height = static_cast<png_uint_32>(size_px.y);
  png.format = format;
  if (png_image_write_to_file(&png, path.c_str(), 0, bytes, 0, nullptr) == 0) {
    throw InputError(path.string(), "", png.message, "does the folder exist, is there room?");
  }
}

}  // namespace

Image read_png(const std::filesystem::path& path) {
  PngImage png;
  if (png_image_begin_read_from_file(&png, path.c_str()) == 0) {
    throw InputError(path.string(), "", png.message, "a PNG picture is expected");
  }
  if (png.width > max_image_side_px || png.height > max_image_side_px) {
    throw InputError(path.string(), "size", fmt::format("{}x{} pixels", png.width, png.height),
                     fmt::format("at most {} per side", max_image_side_px));
  }
  png.format = PNG_FORMAT_RGB;
  png.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
  std::vector<std::uint8_t> bytes(PNG_IMAGE_SIZE(png));
  const png_color black{0, 0, 0};
  if (png_image_finish_read(&png, &black, bytes.data(), 0, nullptr) == 0) {
    throw InputError(path.string(), "", png.message, "the file is damaged");
  }
  Image image;
  image.size_px = {static_cast<int>(png.width), static_cast<int>(png.height)};
  image.rgb.resize(bytes.size());
  std::ranges::transform(bytes, image.rgb.begin(),
                         [](std::uint8_t byte) { return static_cast<float>(byte) / 255.0f; });
  return image;
}

void write_png(const std::filesystem::path& path, const Image& image,
               std::span<const float> alpha) {
  assert(alpha.empty() || alpha.size() == image.pixels());
  const auto byte = [](float value) {
    return static_cast<std::uint8_t>(std::lround(255.0f * std::clamp(value, 0.0f, 1.0f)));
  };
  std::vector<std::uint8_t> bytes;
  bytes.reserve(image.pixels() * (alpha.empty() ? 3 : 4));
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    // A PNG's colour is what an opaque pixel would have.
    const float share = alpha.empty() || alpha[i] <= 0.0f ? 1.0f : alpha[i];
    for (std::size_t c = 0; c < 3; ++c) bytes.push_back(byte(image.rgb[3 * i + c] / share));
    if (!alpha.empty()) bytes.push_back(byte(alpha[i]));
  }
  write_bytes(path, image.size_px, alpha.empty() ? PNG_FORMAT_RGB : PNG_FORMAT_RGBA, bytes.data());
}

void write_png(const std::filesystem::path& path, glm::ivec2 size_px,
               std::span<const std::uint8_t> rgb) {
  assert(rgb.size() ==
         3 * static_cast<std::size_t>(size_px.x) * static_cast<std::size_t>(size_px.y));
  write_bytes(path, size_px, PNG_FORMAT_RGB, rgb.data());
}

Image copy_image(const FrameView& frame) {
  if (frame.format != PixelFormat::rgb_f32 || frame.space != MemorySpace::host) {
    throw std::invalid_argument("copy_image: needs an rgb_f32 frame in host memory");
  }
  Image image;
  image.size_px = frame.size_px;
  const std::size_t row_floats = static_cast<std::size_t>(frame.size_px.x) * 3;
  image.rgb.resize(row_floats * static_cast<std::size_t>(frame.size_px.y));
  for (int y = 0; y < frame.size_px.y; ++y) {
    const auto row = static_cast<std::size_t>(y);
    std::memcpy(image.rgb.data() + row * row_floats,
                frame.planes[0].data + row * frame.planes[0].stride_bytes,
                row_floats * sizeof(float));
  }
  return image;
}

}  // namespace catgs
