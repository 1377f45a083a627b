#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace catgs {

/// A character of UTF-8: the shortest form, no surrogate, at most U+10FFFF.
struct Utf8Character {
  std::uint32_t code_point = 0;
  std::size_t bytes = 0;  // 0: there is none
};

/// What `text` begins with.
inline Utf8Character first_character(std::string_view text) {
  constexpr std::array<std::uint32_t, 5> least = {0, 0, 0x80, 0x800, 0x10000};  // by bytes
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  if (text.empty()) return {};
  if (byte(0) < 0x80) return {byte(0), 1};
  const auto bytes = static_cast<std::size_t>(std::countl_one(byte(0)));
  if (bytes < 2 || bytes > 4 || bytes > text.size()) return {};
  std::uint32_t code_point = byte(0) & (0x7fu >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return {};
    code_point = code_point << 6 | (byte(i) & 0x3fu);
  }
  const bool surrogate = 0xd800 <= code_point && code_point <= 0xdfff;
  if (code_point < least[bytes] || surrogate || code_point > 0x10ffff) return {};
  return {code_point, bytes};
}

/// Text of others for a terminal or a line of a log: what would move the cursor, change a colour or
/// begin a line of its own (U+0000 to U+001F, U+007F to U+009F) and what is not UTF-8 come out by
/// their bytes, as \\x1b. Text that went through it stays as it is.
inline std::string printable(std::string_view text) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const auto [code_point, bytes] = first_character(text);
    const std::string_view piece = text.substr(0, std::max<std::size_t>(bytes, 1));
    text.remove_prefix(piece.size());
    const bool controls = code_point < 0x20 || (0x7f <= code_point && code_point < 0xa0);
    if (bytes > 0 && !controls) {
      out.append(piece);
      continue;
    }
    for (const char c : piece) {
      const auto byte = static_cast<unsigned char>(c);
      out.append("\\x").append(1, digits[byte >> 4]).append(1, digits[byte & 0xf]);
    }
  }
  return out;
}

/// At most `max_bytes`, of UTF-8 whole characters.
inline std::string shortened(std::string_view text, std::size_t max_bytes) {
  const auto continues_character = [&](std::size_t i) {
    return (static_cast<unsigned char>(text[i]) & 0xc0) == 0x80;
  };
  if (text.size() <= max_bytes) return std::string(text);
  std::size_t end = max_bytes;
  while (end > 0 && max_bytes - end < 3 && continues_character(end)) --end;
  return std::string(text.substr(0, continues_character(end) ? max_bytes : end));
}

}  // namespace catgs
