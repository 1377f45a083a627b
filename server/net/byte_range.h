#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace catgs {

struct ByteRange {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;  // 0: the range lies behind the end
};

/// The part of `size` bytes that a Range header asks for (RFC 9110, one range of bytes). Nothing:
/// the whole; so are headers of several ranges and of other forms, which a server may ignore.
std::optional<ByteRange> requested_range(std::string_view header, std::uint64_t size);

}  // namespace catgs
