#pragma once

#include <string>
#include <string_view>

namespace catgs::test {

/// Beginnings of files, just long enough to tell their type and size.
inline std::string png_file(unsigned width = 4, unsigned height = 3) {
  using namespace std::string_literals;
  std::string file = "\x89PNG\r\n\x1a\n\0\0\0\rIHDR"s;
  for (const unsigned side : {width, height})
    for (int shift = 24; shift >= 0; shift -= 8) file += static_cast<char>(side >> shift & 0xff);
  return file + "\x08\x02\0\0\0"s;
}

/// With an EXIF segment of some length before the frame header.
inline std::string jpeg_file(unsigned width = 4, unsigned height = 3) {
  using namespace std::string_literals;
  const auto number = [](unsigned value) {
    return std::string{static_cast<char>(value >> 8), static_cast<char>(value & 0xff)};
  };
  return "\xff\xd8\xff\xe1"s + number(300) + std::string(298, 'x') + "\xff\xff\xc2\0\x11\x08"s +
         number(height) + number(width) + "\x03\x01\x22\0\x02\x11\x01\x03\x11\x01\xff\xda"s;
}

inline std::string mp4_file(std::string_view brand = "isom") {
  using namespace std::string_literals;
  return "\0\0\0\x18"s + "ftyp" + std::string(brand) + "\0\0\0\1isommp42"s + std::string(100, '\0');
}

constexpr std::string_view vtt_file = "WEBVTT\n\n00:00.000 --> 00:02.000\nHello\n";

}  // namespace catgs::test
