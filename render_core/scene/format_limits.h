#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "render_core/scene/byte_source.h"

namespace catgs {

/// Gaussians are indexed with 32 bits everywhere, two of them left for tags; 2^28 Gaussians are
/// already 15 GB without SH.
inline constexpr std::uint64_t max_gaussians = std::uint64_t{1} << 28;

/// Throws InputError when a file announces no Gaussians or more than max_gaussians.
void require_count(const ByteSource& file, std::string_view where, std::uint64_t count);

/// The same for compressed files, where the count cannot be checked against the size: refuses more
/// than 64 Gaussians per compressed byte (2^16 are always allowed). Deflate can reach that with its
/// 1032:1 on Gaussians of 16 bytes, but no real scene comes near; it bounds the memory that a lying
/// header can make us take.
void require_plausible_count(const ByteSource& file, std::string_view where, std::uint64_t count,
                             std::uint64_t compressed_bytes);

/// SH degree with `coefficients` per channel beyond the constant one: 0, 3, 8, 15 or 24 (degree 4);
/// -1 for any other number.
int sh_degree_of_rest(std::size_t coefficients);

}  // namespace catgs
