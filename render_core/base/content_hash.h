#pragma once

#include <cstdint>
#include <string_view>

namespace catgs {

/// FNV-1a, 64 bit. A deliberate collision would gain nothing where it is used.
constexpr std::uint64_t content_hash(std::string_view content) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : content) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return hash;
}

}  // namespace catgs
