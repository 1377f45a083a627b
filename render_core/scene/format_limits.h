#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "render_core/scene/byte_source.h"

namespace catgs {

/// Gaussians are indexed with 32 bits everywhere, two of them left for tags; 2^28 Gaussians are
/// already 15 GB without SH.
inline constexpr std::uint64_t max_gaussians = std::uint64_t{1} << 28;

/// What a byte of a compressed file can expand to: deflate reaches 1:1032, and no scene comes near
/// it. Bounds the memory that a lying header can make us allocate.
inline constexpr std::uint64_t max_compression_ratio = 1032;

/// Throws InputError when a file announces no Gaussians or more than max_gaussians.
void require_count(const ByteSource& file, std::string_view where, std::uint64_t count);

/// SH degree with `coefficients` per channel beyond the constant one: 0, 3, 8, 15 or 24 (degree 4);
/// -1 for any other number.
int sh_degree_of_rest(std::size_t coefficients);

}  // namespace catgs
