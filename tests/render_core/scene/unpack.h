#pragma once

// Reads on the host what pack_cluster() has packed.

#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "render_core/scene/packed_gaussian.h"

namespace catgs::test {

struct Unpacked {
  PackedGeometry geometry;
  math::CovarianceFactor<float> factor;
  std::vector<float> sh;  // without the first, coefficient-major RGB
};

/// Gaussian `i` of a block.
inline Unpacked unpack(std::span<const std::byte> block, const PackedUnits& units, int sh_degree,
                       std::uint32_t i) {
  std::vector<std::byte> record(static_cast<std::size_t>(packed_record_bytes(sh_degree)) + 4);
  for (int at = 0; at < packed_record_bytes(sh_degree);) {
    const int width = packed_plane_width(sh_degree, at);
    std::memcpy(&record[static_cast<std::size_t>(at)], &block[packed_offset(at, width, i)],
                static_cast<std::size_t>(width));
    at += width;
  }
  Unpacked out;
  std::memcpy(&out.geometry, record.data(), sizeof(out.geometry));
  out.factor = unpack_factor(out.geometry.factor, units.factor);
  for (int b = 0; b < packed_sh_bytes(sh_degree); ++b) {
    std::uint32_t word = 0;
    std::memcpy(&word, &record[sizeof(PackedGeometry) + static_cast<std::size_t>(b / 4 * 4)],
                sizeof(word));
    out.sh.push_back(packed_sh(word, b % 4) * (packed_sh_octave(out.geometry.log2_opacity) *
                                               units.sh[sh_degree_of(1 + b / 3) - 1]));
  }
  return out;
}

}  // namespace catgs::test
