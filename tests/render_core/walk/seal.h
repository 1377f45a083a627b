#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

#include <zlib.h>

#include "render_core/walk/walk_file.h"

namespace catgs::test {

inline constexpr std::size_t walk_header_bytes = 320;

/// Writes the checksum of a .walk file.
inline void seal(std::string& bytes) {
  const auto sum = static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data() + 16), bytes.size() - 16));
  std::memcpy(bytes.data() + 12, &sum, sizeof sum);
}

/// A .walk file of a header and tiles that are not packed yet: sizes and checksum are set.
inline std::string packed(const std::string& header, std::span<const std::string> tiles) {
  const std::string rest = walk::packed_tiles(tiles);
  const auto size = static_cast<std::uint32_t>(rest.size());
  std::string bytes = header + rest;
  std::memcpy(bytes.data() + 120, &size, sizeof size);
  seal(bytes);
  return bytes;
}

}  // namespace catgs::test
