#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include <zlib.h>

namespace catgs::test {

inline constexpr std::size_t walk_header_bytes = 320;

/// Writes the checksum of a .walk file.
inline void seal(std::string& bytes) {
  const auto sum = static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data() + 16), bytes.size() - 16));
  std::memcpy(bytes.data() + 12, &sum, sizeof sum);
}

/// A .walk file of a header and a stream that is not packed yet: sizes and checksum are set.
inline std::string packed(const std::string& header, const std::string& stream) {
  uLongf size = compressBound(stream.size());
  std::string bytes = header + std::string(size, '\0');
  compress2(reinterpret_cast<Bytef*>(bytes.data() + header.size()), &size,
            reinterpret_cast<const Bytef*>(stream.data()), stream.size(), 1);
  bytes.resize(header.size() + size);
  const std::uint32_t sizes[2] = {static_cast<std::uint32_t>(stream.size()),
                                  static_cast<std::uint32_t>(size)};
  std::memcpy(bytes.data() + 116, sizes, sizeof sizes);
  seal(bytes);
  return bytes;
}

}  // namespace catgs::test
