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

/// The first character of `text`.
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

/// True for a code point that a reader sees where it stands. False for the general categories Cc,
/// Cf, Zl and Zp (Unicode 16.0, UnicodeData.txt). Controls move the cursor and change colours;
/// format characters reverse the direction of text or are invisible; separators begin lines. False
/// also for the noncharacters (The Unicode Standard, 23.7).
constexpr bool is_printable(std::uint32_t code_point) {
  struct Range {
    std::uint32_t first, last;
  };
  constexpr std::array<Range, 23> unprintable = {{
      {0x0000, 0x001f},   {0x007f, 0x009f},   {0x00ad, 0x00ad},   {0x0600, 0x0605},
      {0x061c, 0x061c},   {0x06dd, 0x06dd},   {0x070f, 0x070f},   {0x0890, 0x0891},
      {0x08e2, 0x08e2},   {0x180e, 0x180e},   {0x200b, 0x200f},   {0x2028, 0x202e},
      {0x2060, 0x2064},   {0x2066, 0x206f},   {0xfeff, 0xfeff},   {0xfff9, 0xfffb},
      {0x110bd, 0x110bd}, {0x110cd, 0x110cd}, {0x13430, 0x1343f}, {0x1bca0, 0x1bca3},
      {0x1d173, 0x1d17a}, {0xe0001, 0xe0001}, {0xe0020, 0xe007f},
  }};
  const bool noncharacter =
      (code_point & 0xfffe) == 0xfffe || (0xfdd0 <= code_point && code_point <= 0xfdef);
  return !noncharacter && std::ranges::none_of(unprintable, [&](const Range& range) {
    return range.first <= code_point && code_point <= range.last;
  });
}

/// Makes foreign text safe for a terminal or a line of a log. Bytes that are not UTF-8 or not
/// printable become escapes such as \\x1b. Escaping twice changes nothing more.
inline std::string printable(std::string_view text) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const auto [code_point, bytes] = first_character(text);
    const std::string_view piece = text.substr(0, std::max<std::size_t>(bytes, 1));
    text.remove_prefix(piece.size());
    if (bytes > 0 && is_printable(code_point)) {
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

/// The longest prefix of whole UTF-8 characters with at most `max_bytes` bytes.
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
