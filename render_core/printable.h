#pragma once

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

}  // namespace catgs
