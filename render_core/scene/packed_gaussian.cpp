#include "render_core/scene/packed_gaussian.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/math/constants.h"
#include "render_core/scene/activations.h"

namespace catgs {
namespace {

constexpr float sh_levels = 127.0f;  // on either side of zero
constexpr float sh_unit_scale = 0x1p15f;
constexpr int factor_bits = 14;  // of an entry, without the sign
constexpr int most_octaves = 63;

using Factor = math::CovarianceFactor<double>;

Factor factor_of(const GaussianCloud& cloud, std::uint32_t i) {
  const glm::dquat q = glm::normalize(glm::dquat(cloud.rotation[i]));
  const glm::dvec3 scale(cloud.scale[i]);
  const double rotation[4] = {q.x, q.y, q.z, q.w};
  return math::covariance_factor<double>(rotation, {scale.x, scale.y, scale.z});
}

/// Binary exponent of the unit in which the largest entry has factor_bits.
int unit_exponent(const Factor& l) {
  int exponent = 0;
  std::frexp(std::max({l.xx, std::abs(l.yx), l.yy, std::abs(l.zx), std::abs(l.zy), l.zz}),
             &exponent);
  constexpr int least = -126 + most_octaves;  // steps are normal floats
  return std::max(exponent - factor_bits, least);
}

void pack_factor(const Factor& l, int cluster_exponent, std::uint32_t (&words)[3]) {
  const int octaves = std::min(cluster_exponent - unit_exponent(l), most_octaves);
  const double steps = std::ldexp(1.0, octaves - cluster_exponent);
  const auto word = [&](int j, double beside, double on) {
    constexpr double most = (1 << factor_bits) - 1;
    const auto signed_bits =
        static_cast<std::int32_t>(std::round(std::clamp(beside * steps, -most, most)));
    const auto bits =
        static_cast<std::uint32_t>(std::round(std::min(on * 2.0 * steps, 2.0 * most + 1.0)));
    words[j] = (static_cast<std::uint32_t>(signed_bits) & 0x7fffu) | bits << 15 |
               (static_cast<std::uint32_t>(octaves) >> 2 * j & 3u) << 30;
  };
  word(0, l.yx, l.xx);
  word(1, l.zx, l.yy);
  word(2, l.zy, l.zz);
}

std::uint8_t pack_sh(float value, float unit) {
  const float steps = unit > 0.0f ? value / unit * sh_unit_scale : 0.0f;
  return static_cast<std::uint8_t>(128.0f + std::clamp(std::round(steps), -sh_levels, sh_levels));
}

/// The largest harmonic of each degree.
std::array<float, max_sh_degree> largest_sh(const GaussianCloud& cloud, std::uint32_t i) {
  std::array<float, max_sh_degree> largest{};
  const glm::vec3* sh = cloud.sh_of(i);
  for (int k = 1; k < cloud.sh_count(); ++k)
    for (int channel = 0; channel < 3; ++channel) {
      float& of_degree = largest[static_cast<std::size_t>(sh_degree_of(k) - 1)];
      of_degree = std::max(of_degree, std::abs(sh[k][channel]));
    }
  return largest;
}

/// The median of those that are not zero; zero if all are.
float typical(std::span<float> values) {
  const auto some = std::partition(values.begin(), values.end(), [](float v) { return v == 0.0f; });
  if (some == values.end()) return 0.0f;
  const auto middle = some + (values.end() - some) / 2;
  std::nth_element(some, middle, values.end());
  return *middle;
}

PackedUnits units_for(const GaussianCloud& cloud, std::span<const std::uint32_t> members,
                      std::span<const Factor> factors) {
  int exponent = std::numeric_limits<int>::min();
  for (const Factor& factor : factors) exponent = std::max(exponent, unit_exponent(factor));
  PackedUnits units{power_of_two(exponent), {}};
  std::array<std::array<float, cluster_size>, max_sh_degree> largest;
  for (std::size_t j = 0; j < members.size(); ++j) {
    const auto of_one = largest_sh(cloud, members[j]);
    for (std::size_t d = 0; d < max_sh_degree; ++d) largest[d][j] = of_one[d];
  }
  // Degrees share a Gaussian's octave. Were one's unit much smaller than the others', a Gaussian
  // with more of that degree than is usual would have coarse harmonics in all of them.
  constexpr float least_of_others = 0.25f;
  std::array<float, max_sh_degree> usual;
  for (std::size_t d = 0; d < max_sh_degree; ++d)
    usual[d] = typical(std::span(largest[d]).first(members.size()));
  const float least = least_of_others * *std::ranges::max_element(usual);
  float times = 0.0f;  // of the usual one
  for (std::size_t d = 0; d < max_sh_degree; ++d) {
    usual[d] = std::max(usual[d], least);
    const float most = *std::max_element(largest[d].begin(), largest[d].begin() + members.size());
    if (most > 0.0f) times = std::max(times, most / usual[d]);
  }
  // The highest octave holds the largest of the cluster. Harmonics are bounded (sanitize), so those
  // of the lowest octave are still finer than a pixel's levels.
  constexpr int highest_octave = least_sh_octave + static_cast<int>(sh_octave_mask);
  const int raised =
      times > 0.0f ? std::max(0, static_cast<int>(std::ceil(std::log2(times))) - highest_octave)
                   : 0;
  for (std::size_t d = 0; d < max_sh_degree; ++d)
    units.sh[d] = std::ldexp(usual[d] / sh_levels * sh_unit_scale, raised);
  return units;
}

/// The least octave that holds a Gaussian's harmonics, as the bits of its record.
std::uint32_t sh_octave(const GaussianCloud& cloud, std::uint32_t i, const PackedUnits& units) {
  const auto largest = largest_sh(cloud, i);
  float times = 0.0f;
  for (std::size_t d = 0; d < max_sh_degree; ++d)
    if (largest[d] > 0.0f)
      times = std::max(times, largest[d] * sh_unit_scale / (sh_levels * units.sh[d]));
  const float octave = std::ceil(std::log2(std::max(times, 0x1p-20f)));
  return static_cast<std::uint32_t>(
      std::clamp(static_cast<int>(octave) - least_sh_octave, 0, static_cast<int>(sh_octave_mask)));
}

/// The level nearest to `level` with these octave bits.
std::uint16_t with_octave(std::uint16_t level, std::uint32_t octave) {
  constexpr int bits = 4, most = 0xffff >> bits;
  static_assert(sh_octave_mask == (1u << bits) - 1);
  const int low = static_cast<int>(octave);
  const int upper = std::clamp((level - low + (1 << (bits - 1))) >> bits, 0, most);
  return static_cast<std::uint16_t>(upper << bits | low);
}

std::uint16_t pack_log2_opacity(float log2_opacity) {
  const float part = std::clamp(log2_opacity / log2_opacity_min, 0.0f, 1.0f);
  return static_cast<std::uint16_t>(std::round(part * 65535.0f));
}

PackedGeometry pack_geometry(const GaussianCloud& cloud, std::uint32_t i, const Factor& factor,
                             const PackedUnits& units) {
  const glm::vec3 &mean = cloud.mean[i], &base = *cloud.sh_of(i);
  PackedGeometry g{{mean.x, mean.y, mean.z},  pack_log2_opacity(std::log2(cloud.opacity[i])),
                   glm::packHalf1x16(base.r), {},
                   glm::packHalf1x16(base.g), glm::packHalf1x16(base.b)};
  if (cloud.sh_degree > 0) g.log2_opacity = with_octave(g.log2_opacity, sh_octave(cloud, i, units));
  pack_factor(factor, std::ilogb(units.factor), g.factor);
  return g;
}

void add_to(ClusterBounds& bounds, const PackedGeometry& g, float unit) {
  const auto l = unpack_factor(g.factor, unit);
  // The Frobenius norm of the factor bounds the largest standard deviation.
  double variance = 0.0;
  for (const float entry : {l.xx, l.yx, l.yy, l.zx, l.zy, l.zz})
    variance += std::pow(static_cast<double>(entry), 2);
  bounds.add({g.mean[0], g.mean[1], g.mean[2]}, std::sqrt(variance),
             unpack_log2_opacity(g.log2_opacity));
}

}  // namespace

PackedCluster pack_cluster(const GaussianCloud& cloud, std::span<const std::uint32_t> members,
                           std::span<std::byte> block) {
  assert(members.size() <= cluster_size);
  std::array<Factor, cluster_size> factors;
  for (std::size_t j = 0; j < members.size(); ++j) factors[j] = factor_of(cloud, members[j]);
  return pack_cluster(cloud, members, std::span(factors).first(members.size()), block);
}

PackedCluster pack_cluster(const GaussianCloud& cloud, std::span<const std::uint32_t> members,
                           std::span<const Factor> factors, std::span<std::byte> block) {
  assert(!members.empty() && members.size() <= cluster_size && factors.size() == members.size());
  assert(block.size() == packed_block_bytes(cloud.sh_degree));
  const PackedUnits units = units_for(cloud, members, factors);

  const int degree = cloud.sh_degree, record_bytes = packed_record_bytes(degree);
  std::array<std::byte, packed_record_bytes(max_sh_degree)> record;
  ClusterBounds bounds;
  for (std::size_t j = 0; j < members.size(); ++j) {
    const PackedGeometry geometry = pack_geometry(cloud, members[j], factors[j], units);
    std::memcpy(record.data(), &geometry, sizeof(geometry));
    const glm::vec3* sh = cloud.sh_of(members[j]);
    const float octave = packed_sh_octave(geometry.log2_opacity);
    for (int b = 0; b < packed_sh_bytes(degree); ++b) {
      const int k = 1 + b / 3;
      record[sizeof(geometry) + b] =
          std::byte{pack_sh(sh[k][b % 3], octave * units.sh[sh_degree_of(k) - 1])};
    }
    for (int at = 0; at < record_bytes;) {
      const int width = packed_plane_width(degree, at);
      std::memcpy(&block[packed_offset(at, width, static_cast<std::uint32_t>(j))], &record[at],
                  static_cast<std::size_t>(width));
      at += width;
    }
    add_to(bounds, geometry, units.factor);
  }
  return {units, bounds.cluster()};
}

void unpack_cluster(std::span<const std::byte> block, const PackedUnits& units, std::size_t count,
                    GaussianCloud& cloud, std::size_t first, std::span<Factor> factors) {
  assert(count <= cluster_size && factors.size() == count && first + count <= cloud.size());
  const int degree = cloud.sh_degree, record_bytes = packed_record_bytes(degree);
  assert(block.size() == packed_block_bytes(degree));
  std::array<std::byte, packed_record_bytes(max_sh_degree)> record;
  for (std::size_t j = 0; j < count; ++j) {
    for (int at = 0; at < record_bytes;) {
      const int width = packed_plane_width(degree, at);
      std::memcpy(&record[at], &block[packed_offset(at, width, static_cast<std::uint32_t>(j))],
                  static_cast<std::size_t>(width));
      at += width;
    }
    PackedGeometry g;
    std::memcpy(&g, record.data(), sizeof(g));
    const auto l = unpack_factor(g.factor, units.factor);
    factors[j] = {l.xx, l.yx, l.yy, l.zx, l.zy, l.zz};
    cloud.mean[first + j] = {g.mean[0], g.mean[1], g.mean[2]};
    // Rounding may have left the ends of the range that sanitize() allows.
    cloud.opacity[first + j] = std::clamp(std::exp2(unpack_log2_opacity(g.log2_opacity)),
                                          static_cast<float>(alpha_min), max_opacity);
    glm::vec3* sh = cloud.sh.data() + (first + j) * cloud.sh_count();
    sh[0] = {from_half(g.base_red), from_half(g.base_green), from_half(g.base_blue)};
    const float octave = packed_sh_octave(g.log2_opacity);
    // Degree by degree, so that the loop needs no other choice and is compiled for many lanes.
    for (int d = 1; d <= degree; ++d) {
      const int begin = packed_sh_bytes(d - 1), end = packed_sh_bytes(d);
      const float unit = octave * units.sh[d - 1];
      float* const to = &sh[1].x;
      for (int b = begin; b < end; ++b)
        to[b] = packed_sh(std::to_integer<std::uint32_t>(record[sizeof(g) + b]), 0) * unit;
    }
  }
}

void clear_sh_octaves(std::span<std::byte> block, std::size_t count) {
  for (std::uint32_t i = 0; i < count; ++i) {
    std::byte* const at = &block[packed_offset(0, 16, i) + offsetof(PackedGeometry, log2_opacity)];
    std::uint16_t level = 0;
    std::memcpy(&level, at, sizeof level);
    level = with_octave(level, -least_sh_octave);
    std::memcpy(at, &level, sizeof level);
  }
}

GaussianAxes axes_of(const Factor& l) {
  glm::dmat3 columns(l.xx, l.yx, l.zx, 0.0, l.yy, l.zy, 0.0, 0.0, l.zz);
  constexpr int most_sweeps = 12;  // convergence is quadratic
  for (int sweep = 0, turned = 1; turned > 0 && sweep < most_sweeps; ++sweep) {
    turned = 0;
    for (int p = 0; p < 2; ++p)
      for (int q = p + 1; q < 3; ++q) {
        const glm::dvec3 a = columns[p], b = columns[q];
        const double aa = glm::dot(a, a), bb = glm::dot(b, b), ab = glm::dot(a, b);
        if (std::abs(ab) <= 1e-15 * std::sqrt(aa * bb)) continue;
        ++turned;
        const double cotangent = (bb - aa) / (2.0 * ab);  // of twice the angle
        const double t = std::copysign(1.0, cotangent) /
                         (std::abs(cotangent) + std::sqrt(1.0 + cotangent * cotangent));
        const double c = 1.0 / std::sqrt(1.0 + t * t);
        columns[p] = c * (a - t * b);
        columns[q] = c * (b + t * a);
      }
  }
  const glm::dvec3 scale(glm::length(columns[0]), glm::length(columns[1]), glm::length(columns[2]));
  // A column without length gets the direction that the longer ones leave.
  int order[3] = {0, 1, 2};
  std::sort(order, order + 3, [&](int a, int b) { return scale[a] > scale[b]; });
  glm::dmat3 axes(1.0);
  if (scale[order[0]] > 0.0) {
    const glm::dvec3 first = columns[order[0]] / scale[order[0]];
    glm::dvec3 second = columns[order[1]] - first * glm::dot(first, columns[order[1]]);
    if (glm::dot(second, second) == 0.0) {
      const glm::dvec3 off = std::abs(first.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
      second = glm::cross(first, off);
    }
    axes[order[0]] = first;
    axes[order[1]] = glm::normalize(second);
    axes[order[2]] = glm::cross(axes[order[0]], axes[order[1]]);
    if (glm::determinant(axes) < 0.0) axes[order[2]] = -axes[order[2]];
  }
  return {glm::normalize(glm::quat(glm::quat_cast(axes))), glm::vec3(scale)};
}

}  // namespace catgs
