#pragma once

#include <iosfwd>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/ply_header.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

struct SceneFormat;

/// Reads the point cloud that the original 3DGS training writes: element `vertex` with x y z,
/// f_dc_0…2, f_rest_* (0, 9, 24, 45 or 72 of them, channel-major), opacity (logit), scale_0…2
/// (logarithms; 2DGS has no scale_2) and rot_0…3 (w, x, y, z). Comments tell the model. Any order,
/// any scalar type, any encoding; normals, other properties and other elements are ignored, SH
/// above degree 3 is cut off. The result is not sanitized, and about `origin`. Throws InputError.
GaussianCloud read_ply(const ByteSource& file, const PlyHeader& header, const LoadContext& context,
                       const glm::dvec3& origin = glm::dvec3(0.0));

/// The same of some rows of a binary file. Its element `vertex` has them, and its rows have a fixed
/// size (require_rows_in_file()). Throws InputError.
GaussianCloud read_ply_rows(const ByteSource& file, const PlyHeader& header, const FileRows& rows,
                            const LoadContext& context, const glm::dvec3& origin = glm::dvec3(0.0));

/// Writes the original's layout: binary little-endian, all float, zero normals. Means, unit
/// rotations and SH are kept bit for bit, scales to 1e-6 (relative), opacities to 1e-7 (absolute).
/// The means of a cloud about another origin than 0 are doubles.
void write_ply(const GaussianCloud& cloud, std::ostream& to,
               const glm::dvec3& origin = glm::dvec3(0.0));

/// This .ply, and PlayCanvas' compressed one.
extern const SceneFormat ply_format;

}  // namespace catgs
