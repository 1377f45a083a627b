#pragma once

#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/scene_format.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/orbit_limits.h"

namespace catgs {

// Niantic's .spz: attributes one after the other, quantised to bytes. Versions 1 (half-float
// positions) to 3 are one gzip stream; version 4 has a plain header and one zstd stream per
// attribute. By its specification the axes are right, up, back unless an extension names one of 16
// other systems.
// Programs that do not turn the axes write files that appear upside down, and nothing in them
// tells: splat-transform 3 (2.7 turned them), Spark 2.2 and spz-js 1.2. A sidecar's "up" corrects
// that.

struct SpzFile {
  int version = 0;
  int sh_degree = 0;                   // of the file, up to 4
  GaussianCloud cloud;                 // not sanitized; SH above degree 3 is cut off
  std::optional<OrbitLimits> orbit{};  // of the extension SPZ_ADOBE_safe_orbit_camera
  std::vector<std::string> notes{};    // for people
  bool names_axes = false;             // by the extension SPZ_ADOBE_coordinate_system
};

/// Whether the file begins like an .spz: gzip or the plain header of version 4.
bool is_spz(const ByteSource& file);

/// Content of the header; the SH degree is that of the file. Throws InputError.
SceneSize read_spz_size(const ByteSource& file);

/// Axes of a cloud that was read: those of GaussianCloud, or whatever the file has. glTF and LCC2
/// say by themselves which axes the .spz inside them have.
enum class SpzAxes { right_down_front, as_stored };

/// Throws InputError.
SpzFile read_spz(const ByteSource& file, const LoadContext& context,
                 SpzAxes axes = SpzAxes::right_down_front);

/// Writes version 3, which every reader in use knows. Positions get as many fractional bits as the
/// largest coordinate leaves room for: at most 16, or up to 23 for small Gaussians. Errors:
/// position 2^-(bits + 1); log scale 1/32 inside [-10, 5.9]; opacity 0.5/255; constant SH 0.5 /
/// (0.15 * 255) inside ±3.3; SH of degree 1 1/32 and above 1/16, inside [-1, 1); quaternion
/// components 0.5 sqrt(1/2) / 511. Throws InputError when a coordinate is over 2^23.
void write_spz(const GaussianCloud& cloud, std::ostream& to);
/// SceneFormat::losses of it.
std::vector<std::string> spz_losses(const GaussianCloud& cloud);

extern const SceneFormat spz_format;

}  // namespace catgs
