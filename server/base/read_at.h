#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace catgs {

/// Fills `bytes` from that offset of an open file. Returns how many there are; fewer: the file ends
/// before, or cannot be read.
std::size_t read_at(int descriptor, std::uint64_t offset, std::span<std::byte> bytes);

}  // namespace catgs
