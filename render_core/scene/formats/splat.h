#pragma once

#include <cstdint>
#include <iosfwd>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

struct SceneFormat;

// The .splat format of antimatter15/splat: 32 bytes per Gaussian and nothing else. Mean and scale
// as floats, colour and opacity as 4 bytes, the quaternion w, x, y, z as bytes around 128.

/// Not sanitized. Throws InputError as count_splat() does.
GaussianCloud read_splat(const ByteSource& file, const LoadContext& context);

/// Number of Gaussians. Throws InputError when the size is no multiple of 32 bytes, or when there
/// are none or more than `most`.
std::uint64_t count_splat(const ByteSource& file, std::uint64_t most = max_gaussians);
/// Some rows of a file that count_splat() accepts.
GaussianCloud read_splat_rows(const ByteSource& file, const FileRows& rows,
                              const LoadContext& context);

/// Colours lose what lies outside [0, 1] and everything view-dependent. Errors: colour and opacity
/// 0.5/255, each quaternion component 0.5/128.
void write_splat(const GaussianCloud& cloud, std::ostream& to);

extern const SceneFormat splat_format;

}  // namespace catgs
