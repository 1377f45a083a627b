#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <png.h>

namespace catgs::test {

/// The bytes of a PNG with its alpha, which read_png() blends away; empty where it cannot be read.
inline std::vector<std::uint8_t> read_rgba(const std::filesystem::path& path) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_file(&png, path.c_str()) == 0) return {};
  png.format = PNG_FORMAT_RGBA;
  std::vector<std::uint8_t> bytes(PNG_IMAGE_SIZE(png));
  if (png_image_finish_read(&png, nullptr, bytes.data(), 0, nullptr) == 0) return {};
  return bytes;
}

}  // namespace catgs::test
