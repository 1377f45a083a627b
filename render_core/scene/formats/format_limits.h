#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/scene/formats/byte_source.h"

namespace catgs {

/// Gaussians are indexed with 32 bits everywhere, two of them left for tags. 2^28 Gaussians already
/// take 15 GB without SH.
inline constexpr std::uint64_t max_gaussians = std::uint64_t{1} << 28;

/// Throws InputError when a file announces no Gaussians or more than `most`.
void require_count(const ByteSource& file, std::string_view where, std::uint64_t count,
                   std::uint64_t most = max_gaussians);

/// The same for compressed files, where the count cannot be checked against the size. Refuses
/// counts that need a compression of more than max_compression : 1. 2^16 Gaussians are always
/// allowed, so a lying header can make us allocate at most 15 MB or about 3,000 times the file's
/// size. `plain_bytes`: decompressed bytes of the file per Gaussian.
void require_plausible_count(const ByteSource& file, std::string_view where, std::uint64_t count,
                             std::size_t plain_bytes, std::uint64_t compressed_bytes,
                             std::uint64_t most = max_gaussians);

/// Far above what captures reach, far below what deflate can (1032).
inline constexpr std::uint64_t max_compression = 256;

/// SH degree with `coefficients` per channel beyond the constant one: 0, 3, 8, 15 or 24 (degree 4);
/// -1 for any other number.
int sh_degree_of_rest(std::size_t coefficients);

/// Adds what people should know about a file, whose words may be in it. Long notes are cut, and
/// repeated and further ones are left out.
void add_note(std::vector<std::string>& notes, std::string_view note);

/// For people: what is left out of harmonics up to `degree`.
std::vector<std::string> notes_of_degree(int degree);

}  // namespace catgs
