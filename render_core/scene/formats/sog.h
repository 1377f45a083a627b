#pragma once

#include <array>
#include <cstdint>
#include <iosfwd>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

struct SceneFormat;

// PlayCanvas' SOG ("spatially ordered Gaussians"): one lossless image (WebP, or PNG) per attribute,
// a texel per Gaussian, and meta.json. As a zip archive (.sog) or as a folder. Version 1 quantises
// between limits, version 2 by codebooks; SH is a palette and a label per Gaussian.

/// The size of a Gaussian in every SOG, decompressed: a texel in each of five images.
inline constexpr std::size_t sog_texel_bytes = 4, sog_least_bytes = 5 * sog_texel_bytes;

/// The checked content of meta.json.
struct SogMeta {
  /// For each channel, the 256 values that a texel's byte can stand for.
  using Channel = std::array<float, 256>;

  int version = 2;
  std::string folder;  // folder of the images, "" or ending in "/"
  std::uint64_t count = 0;
  int sh_degree = 0;
  SplatModel model = SplatModel::standard;
  std::vector<std::string> notes{};                 // for people
  glm::dvec3 min_log_mean{0.0}, max_log_mean{0.0};  // of sign(x) ln(|x| + 1)
  std::array<Channel, 3> log_scale{}, sh0{};
  Channel opacity{};
  Channel sh_rest{};
  std::uint64_t palette_size = 0;
  std::string means_low, means_high, quats, scales, sh0_image, centroids, labels;

  /// Whether the file alone leaves the SH degree open: that of version 1 is in the images' sizes.
  [[nodiscard]] bool hides_sh_degree() const { return !centroids.empty() && sh_degree == 0; }
};

/// Reads and checks `name` (…/meta.json) alone: no image is opened. Throws InputError naming the
/// field.
SogMeta parse_sog_meta(const FileSet& files, const std::string& name);

/// The same, and the sizes of the images; only they tell the SH degree of version 1.
SogMeta read_sog_meta(const FileSet& files, const std::string& name);

/// Gaussians [begin, begin + count) of a SOG, to be stored from `destination` on in the cloud.
struct SogRange {
  std::size_t begin = 0;
  std::size_t count = 0;
  std::size_t destination = 0;
};

/// Decodes ranges into a cloud that has room for them, about `origin`; coefficients above the SOG's
/// degree stay as they are. Sets the cloud's model. One image per thread is in memory at a time.
/// Throws InputError.
void decode_sog(const FileSet& files, const SogMeta& meta, std::span<const SogRange> ranges,
                GaussianCloud& cloud, const LoadContext& context,
                const glm::dvec3& origin = glm::dvec3(0.0));

struct SogFile {
  int version = 0;
  GaussianCloud cloud;  // not sanitized
  std::vector<std::string> notes{};
  glm::dvec3 origin{0.0};  // that the cloud is about
};

/// Reads the whole SOG whose meta data is `meta_name`. Throws InputError.
SogFile read_sog(const FileSet& files, const std::string& meta_name, const LoadContext& context);

/// Writes version 2 as a zip archive, in the order of a Morton curve. Its bytes depend on the cloud
/// alone. Errors: means 1/131070 of the range of their logarithms; quaternion components
/// 0.5 sqrt(2) / 255; opacity 0.5/255. Scales and constant SH are the nearest of 256 values each.
/// SH above is the nearest of 256 values too, of at most 65,536 palette entries, so a larger scene
/// shares entries. Throws InputError when there are more Gaussians than an image has room for.
/// The means are written as they are, about their origin: 16 bits of a logarithm hold no scene of
/// more than 13 units to 1e-4, and other programs read them into floats.
void write_sog(const GaussianCloud& cloud, ThreadPool& pool, std::ostream& to);
/// SceneFormat::losses of it.
std::vector<std::string> sog_losses(const GaussianCloud& cloud);

extern const SceneFormat sog_format;

}  // namespace catgs
