#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/orbit_limits.h"

// Writers of the formats that the product only reads, straight from the formats' descriptions and
// independent of the readers' code.
namespace catgs::test {

std::string gzip(const std::string& bytes);

/// A zip archive with stored or deflated entries.
std::string zip(const std::map<std::string, std::string>& files, bool deflated = false);

struct SpzStyle {
  int version = 3;
  int fractional_bits = 12;
  /// Number in the coordinate system extension; 0 writes no extension, and the cloud (right, down,
  /// front) is stored as right, up, back. Otherwise the cloud is stored as it is.
  std::uint32_t coordinate_system = 0;
  std::optional<OrbitLimits> orbit{};  // in an extension
  int extra_sh_degree = 0;  // stores coefficients up to this degree, the additional ones nonsense
};
std::string encode_spz(const GaussianCloud& cloud, const SpzStyle& style);

std::string encode_compressed_ply(const GaussianCloud& cloud, bool colour_limits);

/// File name to content of a SOG folder. Each Gaussian has its own palette entry, so at most 65536.
std::map<std::string, std::string> encode_sog(const GaussianCloud& cloud, int version);

/// Name to content of the files below a folder, as zip() takes them.
std::map<std::string, std::string> files_below(const std::filesystem::path& folder);

/// Lossless (or lossy) WebP of RGBA texels.
std::string encode_webp(const std::string& rgba, int width, int height, bool lossless = true);
/// PNG of 8 bits a channel. Without alpha, the fourth of each texel's bytes is left out.
std::string encode_png(const std::string& rgba, int width, int height, bool alpha = true);

}  // namespace catgs::test
