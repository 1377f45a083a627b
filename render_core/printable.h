#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace catgs {

/// Text of others for a terminal or a line of a log: what would move the cursor, change a colour or
/// begin a line of its own comes out as \\x1b. Text that went through it stays as it is.
inline std::string printable(std::string_view text) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f)
      out.append("\\x").append(1, digits[byte >> 4]).append(1, digits[byte & 0xf]);
    else
      out.push_back(c);
  }
  return out;
}

/// At most `max_bytes` of UTF-8, whole characters.
inline std::string shortened(std::string_view text, std::size_t max_bytes) {
  const auto continues_character = [&](std::size_t i) {
    return (static_cast<unsigned char>(text[i]) & 0xc0) == 0x80;
  };
  if (text.size() <= max_bytes) return std::string(text);
  while (max_bytes > 0 && continues_character(max_bytes)) --max_bytes;
  return std::string(text.substr(0, max_bytes));
}

}  // namespace catgs
