#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#if defined(__CUDACC__)
#include <cuda_fp16.h>
#else
#include <glm/gtc/packing.hpp>
#endif

#include "render_core/base/host_device.h"
#include "render_core/math/projection-inl.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

// How the CUDA core and the pages of a tree store Gaussians: 77 bytes each with harmonics of degree
// 3, where plain floats take 236.
//
// A Gaussian is a record: geometry and base colour, then a byte for every higher harmonic. A block
// holds the records of a cluster plane by plane: the first 16 bytes of all records, the next 16 of
// all, and so on. The end of a record is in planes of 8, 4, 2 and 1 bytes. Thus every load is a
// whole word, neighbours' loads are one access, and no byte is padding.

/// The first part of a record. Halves are IEEE binary16, as bits.
struct PackedGeometry {
  float mean[3];               // world; not rounded: view depth decides the blending order
  std::uint16_t log2_opacity;  // see unpack_log2_opacity() and packed_sh_octave()
  std::uint16_t base_red;      // halves: the first harmonic
  std::uint32_t factor[3];     // see unpack_factor()
  std::uint16_t base_green, base_blue;
};
static_assert(sizeof(PackedGeometry) == 32);

/// The units of the numbers in a cluster's records.
struct alignas(16) PackedUnits {
  float factor;  // of the cluster's largest Gaussian, a power of two
  // For the harmonics of degree 1, 2 and 3: the largest of the median Gaussian is 127 / 2^15. No
  // unit is under a quarter of another, and all are a power of two larger where the highest octave
  // would not hold the cluster's largest. So no Gaussian's extremes decide how finely the others
  // are stored.
  float sh[3];
};

constexpr int packed_sh_bytes(int sh_degree) { return 3 * (sh_coefficient_count(sh_degree) - 1); }
constexpr int packed_record_bytes(int sh_degree) {
  return static_cast<int>(sizeof(PackedGeometry)) + packed_sh_bytes(sh_degree);
}
constexpr std::size_t packed_block_bytes(int sh_degree) {
  return cluster_size * static_cast<std::size_t>(packed_record_bytes(sh_degree));
}

/// Bytes of each record in the plane that begins at byte `at`.
constexpr int packed_plane_width(int sh_degree, int at) {
  int width = 16;
  while (width > packed_record_bytes(sh_degree) - at) width /= 2;
  return width;
}

/// Offset in a block of a Gaussian's data in the plane that begins at byte `at`.
CATGS_HD constexpr std::uint32_t packed_offset(int at, int width, std::uint32_t in_cluster) {
  return static_cast<std::uint32_t>(at) * static_cast<std::uint32_t>(cluster_size) +
         static_cast<std::uint32_t>(width) * in_cluster;
}

/// 2^exponent, -126 to 127.
CATGS_HD inline float power_of_two(int exponent) {
  const auto bits = static_cast<std::uint32_t>(127 + exponent) << 23;
#if defined(__CUDA_ARCH__)
  return __uint_as_float(bits);
#else
  return std::bit_cast<float>(bits);
#endif
}

CATGS_HD inline float from_half(std::uint16_t bits) {
#if defined(__CUDACC__)
  return __half2float(__ushort_as_half(bits));
#else
  return glm::unpackHalf1x16(bits);
#endif
}

/// 65536 levels from 0 to -8, which is below visibility (log2_alpha_min).
constexpr float log2_opacity_min = -8.0f;
CATGS_HD inline float unpack_log2_opacity(std::uint32_t level) {
  return static_cast<float>(level) * (log2_opacity_min / 65535.0f);
}

/// The four low bits of an opacity's level are also those of its harmonics' octave: the power of
/// two that a Gaussian's units are larger than the cluster's by. It is the least one that holds the
/// harmonics of all degrees, so an extreme one is coarse for its own Gaussian alone. The other
/// twelve bits bring the level as near to the opacity as they can: within 0.07 %, at the
/// opaque end 0.13 %. Without higher harmonics all bits are the opacity's.
constexpr std::uint32_t sh_octave_mask = 15;
constexpr int least_sh_octave = -6;
CATGS_HD inline float packed_sh_octave(std::uint32_t log2_opacity) {
  return power_of_two(least_sh_octave + static_cast<int>(log2_opacity & sh_octave_mask));
}

/// A covariance factor has one exponent for all entries: the number of octaves below the cluster's
/// unit. One exponent is enough, because the ends of a needle move by the entries' error relative
/// to the largest one. That is 2^-15, where halves would leave 2^-12. The words hold yx xx, zx yy
/// and zy zz: an off-diagonal entry (bits 0 to 14, signed) and a diagonal one (bits 15 to 29, in
/// half the unit). Two bits of the exponent follow in each.
CATGS_HD inline math::CovarianceFactor<float> unpack_factor(const std::uint32_t (&words)[3],
                                                            float unit) {
  const std::uint32_t octaves = words[0] >> 30 | words[1] >> 30 << 2 | words[2] >> 30 << 4;
  const float step = unit * power_of_two(-static_cast<int>(octaves));
  const auto beside = [&](int j) {
    return static_cast<float>(static_cast<std::int32_t>(words[j] << 17) >> 17) * step;
  };
  const auto on = [&](int j) {
    return static_cast<float>(words[j] >> 15 & 0x7fffu) * (0.5f * step);
  };
  return {on(0), beside(0), on(1), beside(1), beside(2), on(2)};
}

/// A harmonic in its Gaussian's units of its degree, from byte j of four: (byte - 128) / 2^15.
CATGS_HD inline float packed_sh(std::uint32_t word, int j) {
#if defined(__CUDA_ARCH__)
  // The byte in bits 8 to 15 of 1 + byte / 2^15: exact, and cheaper than a conversion.
  return __uint_as_float(__byte_perm(word, 0x3f800000u, 0x7604u | j << 4)) - 1.00390625f;
#else
  return static_cast<float>(static_cast<int>(word >> 8 * j & 0xffu) - 128) * 0x1p-15f;
#endif
}

struct PackedCluster {
  PackedUnits units;
  Cluster bounds;  // of the Gaussians after packing
};

/// Packs the `members` of the cloud (1 to cluster_size indices) into `block`, which is
/// packed_block_bytes() of zeros. All values are rounded to nearest.
PackedCluster pack_cluster(const GaussianCloud& cloud, std::span<const std::uint32_t> members,
                           std::span<std::byte> block);

/// The same with the covariance factor of each member. The cloud's rotations and scales are not
/// read.
PackedCluster pack_cluster(const GaussianCloud& cloud, std::span<const std::uint32_t> members,
                           std::span<const math::CovarianceFactor<double>> factors,
                           std::span<std::byte> block);

/// Writes the first `count` Gaussians of a block to the cloud, from index `first` on, and their
/// factors to `factors`, which has `count` entries. The cloud has room for them and the block's
/// degree. Its rotations and scales stay as they are; see axes_of().
void unpack_cluster(std::span<const std::byte> block, const PackedUnits& units, std::size_t count,
                    GaussianCloud& cloud, std::size_t first,
                    std::span<math::CovarianceFactor<double>> factors);

/// Gives `count` records of a block the octave 0, that of trees of version 1, whose units hold the
/// largest harmonics of the cluster. Their opacities are rounded as those of new records.
void clear_sh_octaves(std::span<std::byte> block, std::size_t count);

/// Rotation and scale with R diag(scale^2) R^T = L L^T, by one-sided Jacobi rotations of L's
/// columns (Demmel, Veselic 1992).
struct GaussianAxes {
  glm::quat rotation;
  glm::vec3 scale;
};
GaussianAxes axes_of(const math::CovarianceFactor<double>& factor);

}  // namespace catgs
